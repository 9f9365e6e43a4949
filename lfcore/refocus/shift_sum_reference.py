"""Shift-sum refocusing by the letter of equation 6.1, in metres and float64; slow, for tests."""

import numpy as np

from lfcore.optics.camera import image_distance
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab


def shift_sum_reference(
    slab: Slab, views: np.ndarray, plane: SensorPlane, filter: str = "nearest"
) -> np.ndarray:
    """One picture (M, M, 3) float64 of views (N, N, M, M, 3), linear light, [j, i, v, u].

    The ray of lens point U that arrives at x' on the sensor at v' = alpha v crosses the recorded
    one at ``U + (x' - U) / alpha``.  Pictures stand on their head on a sensor, so a tangent tau is
    at ``-tau v``.
    """
    size, lens = slab.pixels, slab.lens_positions()
    recorded = slab.camera.image_distance_m
    alpha = image_distance(slab.camera.focal_length_m, plane.focus_m) / recorded
    grid = slab.pixel_tangents() * (1.0 if plane.keep_magnification else alpha)
    pitch = slab.pixel_pitch * recorded
    total, weight, mask = np.zeros((size, size, 3)), np.zeros((size, size)), plane.mask(slab)
    for j in range(slab.views):
        for i in range(slab.views):
            if not mask[j, i]:
                continue
            x, y = (-(u + (-grid * recorded - u) / alpha) / pitch for u in (lens[i], lens[j]))
            for column, across in _neighbours(x + (size - 1) / 2, filter):
                for row, down in _neighbours(y + (size - 1) / 2, filter):
                    share = np.outer(down * _inside(row, size), across * _inside(column, size))
                    read = views[j, i][row.clip(0, size - 1)][:, column.clip(0, size - 1)]
                    total += share[..., None] * read
                    weight += share
    if plane.normalise == "lens":
        zoom = alpha if plane.keep_magnification else 1.0
        return total / (slab.views * zoom) ** 2
    return total / np.where(weight > 1e-9, weight, np.inf)[..., None]


def _neighbours(position: np.ndarray, filter: str) -> list[tuple[np.ndarray, np.ndarray]]:
    """(pixel, share) of what is read at ``position``."""
    # Where two pixels are equally near, rounding decides; slicing takes the smaller one here.
    if filter == "nearest":
        return [(np.ceil(np.round(position, 9) - 0.5).astype(int), np.ones(len(position)))]
    low = np.floor(position).astype(int)
    return [(low, 1 - (position - low)), (low + 1, position - low)]


def _inside(index: np.ndarray, size: int) -> np.ndarray:
    return ((index >= 0) & (index < size)).astype(float)
