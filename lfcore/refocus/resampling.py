"""Where a refocused picture reads each view, and how much of it there is to read.

Equation 6.1 of the thesis, in pixels: with alpha = v'/v, pixel X of the picture reads the view of
lens column i at

    u = (X - c) / m + c - shift_i        c the middle, m = alpha with the magnification kept, else 1

Columns and rows are alike and independent, so all of it is tables of one axis.

There is no sharper kernel: a cubic one (Keys, a = -1/2) was measured against pictures traced
directly and lay within 0.7 dB of the better of these two, above it or below.
"""

import numpy as np

from lfcore.errors import OpticsError, check_known
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab

FILTERS = ("nearest", "bilinear")
"""Of views as they are; a file with depth has the filter ``depth``, too."""


def taps(slab: Slab, plane: SensorPlane, filter: str) -> tuple[np.ndarray, np.ndarray]:
    """Source pixels of every output pixel: (N, M) int32 ``first`` and (N, M) float32 ``share``.

    Pixel X of the picture reads pixel ``first[i, X]`` of lens column i with weight 1 - share and
    the next one with ``share``.  The nearest pixel is the one from which slicing throws to X,
    where the magnification is not kept: a shift by one whole number.
    """
    check_known(OpticsError, "filter", filter, FILTERS)
    pixels, shifts = np.arange(slab.pixels), plane.shifts(slab)
    magnification, centre = plane.magnification(slab), (slab.pixels - 1) / 2
    if magnification == 1.0 and filter == "nearest":
        first = pixels - np.floor(shifts + 0.5)[:, None]
        return first.astype(np.int32), np.zeros(first.shape, np.float32)
    position = (pixels - centre) / magnification + centre - shifts[:, None]
    position = np.clip(position, -1e6, 1e6)
    if filter == "nearest":
        return np.ceil(position - 0.5).astype(np.int32), np.zeros(position.shape, np.float32)
    first = np.floor(position)
    return first.astype(np.int32), (position - first).astype(np.float32)


def coverage(slab: Slab, plane: SensorPlane, filter: str) -> np.ndarray:
    """(M, M) float64: how many views, or shares of views, a pixel reads.

    Separable but for the aperture: A mask B^T, A[Y, j] the share of row j that lies within, and B
    that of columns.
    """
    first, share = taps(slab, plane, filter)
    left, top, width, height = slab.held.pixels
    down, across = (
        _within(first, share, low, low + length) for low, length in ((top, height), (left, width))
    )
    return down.T @ plane.mask(slab).astype(np.float64) @ across


def _within(first: np.ndarray, share: np.ndarray, low: int, high: int) -> np.ndarray:
    """How much of each pair of taps lies among pixels [low, high)."""
    inside = np.where((first >= low) & (first < high), 1 - share.astype(np.float64), 0)
    return inside + np.where((first >= low - 1) & (first < high - 1), share, 0)


def normalise(slab: Slab, plane: SensorPlane, filter: str, sums: np.ndarray) -> np.ndarray:
    """(M, M, 3) float32 picture of sums (3, M, M) of linear light; black where nothing was read.

    Dimmed pictures are divided by N^2 and by m^2 as well: a sensor farther from the lens spreads
    the same light over more pixels.
    """
    if plane.normalise == "lens":
        weight = np.asarray(slab.views_held().sum() * plane.magnification(slab) ** 2, np.float64)
    else:
        weight = coverage(slab, plane, filter)
        weight = np.where(weight > 1e-9, weight, np.inf)
    return np.ascontiguousarray((sums / weight).transpose(1, 2, 0), np.float32)


def crop(slab: Slab, pictures: np.ndarray) -> np.ndarray:
    """Pictures (P, height, width, 3) of the pixels that are there, of pictures (P, M, M, 3)."""
    left, top, width, height = slab.held.pixels
    return np.ascontiguousarray(pictures[:, top : top + height, left : left + width])
