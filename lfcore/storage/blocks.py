"""Rectangles of rays, decoded from a light field file's frames."""

from bisect import bisect_left
from collections.abc import Collection, Iterator

import numpy as np

from lfcore.colour import srgb_codes, to_uint8
from lfcore.optics.slab import Ends
from lfcore.storage.index import Segment
from lfcore.storage.layout import FrameLayout
from lfcore.storage.pixels import pixel_format
from lfcore.storage.stored_video import StoredVideo
from lfcore.storage.ycbcr import rgb_from_planes

CHUNK_BYTES = 4 << 20
"""The bytes of frames that are decoded at a time; their rays take some 50 MB as floats."""
FULL = {8: "yuv444p", 10: "yuv444p10le", 12: "yuv444p12le"}
"""The formats without chroma subsampling, by bits per sample."""


def read_block(
    video: StoredVideo,
    outer: Ends,
    inner: Ends,
    *,
    codes: bool,
    damaged: Collection[int] = (),
) -> np.ndarray:
    """Decode a rectangle of the outer grid, and of each element's inner grid.

    Returns (outer rows, outer columns, inner rows, inner columns, 3): float32 linear light up to
    1, or uint8 sRGB codes.  ``damaged`` segments stay black.
    """
    layout = video.layout
    shape = (outer[3] - outer[1], outer[2] - outer[0], inner[3] - inner[1], inner[2] - inner[0])
    out = np.zeros((*shape, 3), np.uint8 if codes else np.float32)
    corner = np.array(outer[:2], np.int32)
    for index in video.metadata.segments.meeting(*outer):
        if index in damaged:
            continue
        part = video.metadata.segments[index]
        video.check_once(part.index)  # before arrays of its size are made
        elements = part.tile.elements()
        elements = elements[(elements >= corner).all(1) & (elements < outer[2:]).all(1)]
        places = part.tile.placement(elements)
        for frames, frame_of, chosen in _needed_frames(video, part, places[:, 0]):
            column, row = (elements[chosen] - corner).T
            encoded = windows(layout, frames, frame_of, places[chosen, 1:], inner)
            out[row, column] = _codes(layout, encoded) if codes else layout.decoded(encoded)
    return out


def _codes(layout: FrameLayout, encoded: np.ndarray) -> np.ndarray:
    """Convert encoded values to uint8 sRGB; light above white is clipped."""
    return to_uint8(encoded) if layout.peak is None else srgb_codes(layout.decoded(encoded))


def _needed_frames(
    video: StoredVideo, part: Segment, numbers: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray, slice]]:
    """Decode the frames ``numbers`` (ascending) of a segment, some at a time.

    Yields a chunk of frames, a slice of ``numbers``, and for each number in this slice the index
    of its frame in the chunk; the slice is the last.
    """
    needed = np.unique(numbers)
    step = max(1, CHUNK_BYTES // video.layout.frame_bytes)
    in_segment = slice(bisect_left(video.keys, part.first), bisect_left(video.keys, part.stop))
    keys = np.array([key - part.first for key in video.keys[in_segment]] or [0])
    entry = keys[np.searchsorted(keys, needed, side="right") - 1]
    # The frames between wanted ones are decoded, too, unless a key frame lets us skip them.
    for run in np.split(needed, np.flatnonzero(entry[1:] > needed[:-1] + 1) + 1):
        first = int(run[0])
        for chunk in video.frames(part.index, first, int(run[-1]) + 1, chunk=step):
            low, high = np.searchsorted(numbers, (first, first + len(chunk)))
            if low < high:
                yield chunk, numbers[low:high] - first, slice(low, high)
            first += len(chunk)


def windows(
    layout: FrameLayout,
    frames: np.ndarray,
    which: np.ndarray,
    corners: np.ndarray,
    inner: Ends,
) -> np.ndarray:
    """Take the rectangle ``inner`` of each of E elements out of frames.

    ``corners`` (E, 2) are the elements' first pixels in frames ``which`` (E,).  Returns
    (E, rows, columns, 3) float32 in [0, 1], encoded.
    """
    form = layout.format
    pictures = []
    for index, plane in enumerate(form.views(frames, layout.frame_width, layout.frame_height)):
        # Chroma is repeated over its 2 x 2 pixels, as in refocusing.  This keeps a macropixel's
        # mean, is 4 dB better than interpolation, and does not mix elements.
        step = form.subsampling if index else 1
        x, y = corners.T
        columns = (x[:, None] + np.arange(inner[0], inner[2])) // step
        rows = (y[:, None] + np.arange(inner[1], inner[3])) // step
        pictures.append(plane[which[:, None, None], rows[:, :, None], columns[:, None, :]])
    whole = pixel_format(FULL[form.bits]) if form.subsampling > 1 else form
    return rgb_from_planes(pictures, whole)
