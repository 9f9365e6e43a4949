"""Rectangles of many macropixels or views at once, out of frames."""

from __future__ import annotations

import numpy as np

from lfcore.storage.colour import rgb_from_planes, to_uint8
from lfcore.storage.layout import FrameLayout


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
    step, slot = form.subsampling, layout.slot
    # With a margin for the interpolation of chroma, which stays within the element.
    low = [max(0, value // step - 1) for value in inner[:2]]
    high = [min(slot // step, -(-value // step) + 1) for value in inner[2:]]
    planes = form.views(frames, layout.frame_width, layout.frame_height)
    cut = []
    for index, plane in enumerate(planes):
        scale = step if index == 0 else 1
        x, y = (corners // (step if index else 1)).T
        columns = x[:, None] + np.arange(low[0] * scale, high[0] * scale)
        rows = y[:, None] + np.arange(low[1] * scale, high[1] * scale)
        cut.append(plane[which[:, None, None], rows[:, :, None], columns[:, None, :]])
    pictures = rgb_from_planes(cut, form)
    x, y = inner[0] - low[0] * step, inner[1] - low[1] * step
    return to_uint8(pictures[:, y : y + inner[3] - inner[1], x : x + inner[2] - inner[0]])
