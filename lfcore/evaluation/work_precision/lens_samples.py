"""Pictures through samples of the lens that are not a grid: one beam of rays a lens point."""

from __future__ import annotations

import math

import numpy as np
from scipy.stats import qmc

from lfcore.errors import OpticsError
from lfcore.optics.bundles import Bundles
from lfcore.optics.camera import Camera
from lfcore.optics.slab import Slab
from lfcore.refocus.array.sampling import concentric_disk
from lfcore.tracing.tracer import Tracer

PATTERNS = ("stratified", "Halton", "independent")
CHUNK_BYTES = 32 << 20


def lens_points(pattern: str, side: int, seed: int) -> np.ndarray:
    """(side^2, 2) float64 points of the unit disk, by one of :data:`PATTERNS`.

    Points of the unit square go to the disk by the concentric map, which keeps areas.  Raises
    :class:`OpticsError` for another pattern.
    """
    rng, count = np.random.default_rng(seed), side * side
    if pattern == "independent":
        square = rng.random((count, 2))
    elif pattern == "stratified":
        cells = np.stack(np.meshgrid(np.arange(side), np.arange(side)), -1).reshape(-1, 2)
        square = (cells + rng.random((count, 2))) / side
    elif pattern == "Halton":
        square = qmc.Halton(d=2, scramble=True, rng=rng).random(count)
    else:
        raise OpticsError(f"unknown lens samples {pattern!r}", remedy=f"Use one of {PATTERNS}")
    return np.stack(concentric_disk(square[:, 0], square[:, 1]), axis=1)


def pictures(
    tracer: Tracer, camera: Camera, pixels: int, points: np.ndarray, corners: np.ndarray, side: int
) -> np.ndarray:
    """(W side, side, 3) float64, linear light in [0, 1]: the mean over lens ``points`` (K, 2).

    Parameters
    ----------
    points : of the unit disk.  Each colour is clipped as the tracer's planes clip it.
    corners : (W, 2), first column and row of windows of ``side`` pixels of the picture of
        ``pixels`` a side; they come back one above the other.
    """
    slab = Slab(camera, 1, pixels)
    lens = np.asarray(points, float) * camera.lens_radius_m
    pitch = slab.pixel_pitch
    step = np.array([0.0, 0.0, pitch, pitch], np.float32)
    places, found = _places(lens), []
    some = max(1, CHUNK_BYTES // (12 * side * side))
    for corner in corners:
        middle = (corner + (side - 1) / 2 - (pixels - 1) / 2) * pitch
        directions = middle - camera.delta * lens
        elements = np.concatenate([lens, directions], axis=1).astype(np.float32)
        total = np.zeros((side, side, 3))
        for start in range(0, len(elements), some):
            part = slice(start, start + some)
            beams = Bundles(elements[part], step, side, side, pitch)
            radiance = tracer.bundle_radiance(beams, places[part])
            total += np.clip(radiance, 0, 1, out=radiance).sum(axis=0, dtype=np.float64)
        found.append(total / len(elements))
    return np.concatenate(found)


def _places(lens: np.ndarray) -> np.ndarray:
    """(K, 2) distinct places on a grid, neighbours near each other: beams are made of them."""
    side = math.ceil(math.sqrt(len(lens)))
    rank = np.empty(len(lens), np.int64)
    rank[np.argsort(lens[:, 0], kind="stable")] = np.arange(len(lens))
    column = rank // side
    row = np.empty(len(lens), np.int64)
    order = np.lexsort((lens[:, 1], column))
    row[order] = np.arange(len(lens)) - np.searchsorted(column[order], column[order])
    return np.stack([column, row], axis=1)
