"""Sensor planes by scattering every ray to the pixel that it falls on, float64.

Thesis chapter 4, Algorithm 1, in the form of the design: refocusing from delta to delta' moves
a ray from x_f to ``x_f + s (delta' - delta)``.
"""

import numpy as np

from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab


def form_plane(
    slab: Slab, plane: SensorPlane, light: np.ndarray, *, bilinear: bool = False
) -> np.ndarray:
    """One picture (H, W, 3) float64, linear light, row v and column u, of all rays of the slab,
    (rows, columns, N, N, 3) indexed [v, u, j, i].

    A ray is shared among the four nearest pixels if ``bilinear``, else it falls on the nearest one,
    the larger index where two are equally near.  A pixel is the sum of its rays through the open
    lens samples, divided by their number (or share) with ``normalise='aperture'``, by N^2 with
    ``'lens'``; black where none fell.
    """
    size, views = plane.pixels or slab.pixels, slab.views
    left, top, width, height = slab.picture(size)
    column, row, columns, rows = slab.held.pixels
    total, weight = np.zeros((height, width, 3)), np.zeros((height, width))
    mask = plane.mask(slab)
    for j in range(views):
        for i in range(views):
            if not mask[j, i]:
                continue
            for x, share_x in _targets(slab, plane, i, bilinear):
                x, share_x = (each[column : column + columns] for each in (x - left, share_x))
                for y, share_y in _targets(slab, plane, j, bilinear):
                    y, share_y = (each[row : row + rows] for each in (y - top, share_y))
                    _scatter(total, weight, light[:, :, j, i], x, y, share_x, share_y)
    if plane.normalise == "lens":
        return total / (views * slab.pixels / size) ** 2
    return total / np.where(weight > 0, weight, 1)[:, :, None]


def _targets(
    slab: Slab, plane: SensorPlane, sample: int, bilinear: bool
) -> list[tuple[np.ndarray, np.ndarray]]:
    """(target, share) of the rays of pixels 0 .. M - 1 through one lens column (or row)."""
    size = plane.pixels or slab.pixels
    coarser = plane.magnification(slab) * (size / slab.pixels)
    position = np.arange(slab.pixels) + plane.shifts(slab)[sample] - (slab.pixels - 1) / 2
    position = position * coarser + (size - 1) / 2
    if not bilinear:
        return [(np.floor(position + 0.5).astype(np.int64), np.ones(slab.pixels))]
    low = np.floor(position).astype(np.int64)
    return [(low, 1 - (position - low)), (low + 1, position - low)]


def _scatter(
    total: np.ndarray,
    weight: np.ndarray,
    view: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
    share_x: np.ndarray,
    share_y: np.ndarray,
) -> None:
    height, width = weight.shape
    column, row = np.meshgrid(x, y)
    share = share_y[:, None] * share_x[None, :]
    inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    at = row[inside], column[inside]
    np.add.at(total, at, view[inside] * share[inside][:, None])
    np.add.at(weight, at, share[inside])
