"""Rectangles of many macropixels or views at once, out of frames."""

from __future__ import annotations

import numpy as np

from lfcore.colour import to_uint8
from lfcore.storage.layout import FrameLayout
from lfcore.storage.pixels import pixel_format
from lfcore.storage.ycbcr import rgb_from_planes

FULL = {8: "yuv444p", 10: "yuv444p10le"}
"""Formats of as many bits whose chroma is not subsampled."""


def windows(
    layout: FrameLayout,
    frames: np.ndarray,
    which: np.ndarray,
    corners: np.ndarray,
    inner: tuple[int, int, int, int],
) -> np.ndarray:
    """uint8 (E, rows, columns, 3) sRGB: the same rectangle of each of E elements.

    Parameters
    ----------
    frames : (F, frame_bytes) uint8.
    which, corners : (E,) and (E, 2), the frame of each element and its first pixel there (x, y).
    inner : (column0, row0, column1, row1) of the elements' own grid, half open.
    """
    form = layout.format
    pictures = []
    for index, plane in enumerate(form.views(frames, layout.frame_width, layout.frame_height)):
        # Chroma is repeated over its 2 x 2 pixels, as refocusing does: the mean of a macropixel is
        # then what was stored, 4 dB nearer than interpolated, and nothing leaks between elements.
        step = form.subsampling if index else 1
        x, y = corners.T
        columns = (x[:, None] + np.arange(inner[0], inner[2])) // step
        rows = (y[:, None] + np.arange(inner[1], inner[3])) // step
        pictures.append(plane[which[:, None, None], rows[:, :, None], columns[:, None, :]])
    whole = pixel_format(FULL[form.bits]) if form.subsampling > 1 else form
    return to_uint8(rgb_from_planes(pictures, whole))
