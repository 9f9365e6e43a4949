"""Pictures through samples of lens and pixel together: one beam of rays a sample."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from lfcore.errors import OpticsError
from lfcore.optics.bundles import Bundles
from lfcore.optics.camera import Camera
from lfcore.optics.planes import Aperture
from lfcore.optics.ray_cells import crossed_views, lens_cells
from lfcore.optics.slab import Slab
from lfcore.refocus.array.sampling import concentric_disk
from lfcore.tracing.tracer import Tracer

CROSSED = "crossed grid"
RANDOM = ("stratified", "Halton", "independent")
PATTERNS = (CROSSED, *RANDOM)
CHUNK_BYTES = 32 << 20


@dataclass(frozen=True)
class Samples:
    """Where rays pass: ``lens`` (K, 2) of the unit disk, ``place`` (K, 2) in [-1/2, 1/2] of each
    pixel, the same in all of them, and ``weight`` (K,), whose sum is 1."""

    lens: np.ndarray
    place: np.ndarray
    weight: np.ndarray


def samples(pattern: str, side: int, seed: int) -> Samples:
    """``side`` squared samples by one of :data:`PATTERNS`; those of a grid beyond the rim miss.

    ``stratified`` has one in each stratum of the lens and one in each of the pixel, joined at
    random (R. Cook, T. Porter, L. Carpenter, "Distributed Ray Tracing", SIGGRAPH 1984).  Points of
    the unit square go to the disk by the concentric map, which keeps areas.  Raises
    :class:`OpticsError` for another pattern.
    """
    rng, count = np.random.default_rng(seed), side * side
    if pattern == CROSSED:
        return crossed(side)
    if pattern == "independent":
        points = rng.random((count, 4))
    elif pattern == "stratified":
        cells = np.stack(np.meshgrid(np.arange(side), np.arange(side)), -1).reshape(-1, 2)
        both = np.concatenate([cells, rng.permutation(cells)], axis=1)
        points = (both + rng.random((count, 4))) / side
    elif pattern == "Halton":
        points = qmc.Halton(d=4, scramble=True, rng=rng).random(count)
    else:
        raise OpticsError(f"unknown samples {pattern!r}", remedy=f"Use one of {PATTERNS}")
    lens = np.stack(concentric_disk(points[:, 0], points[:, 1]), axis=1)
    return Samples(lens, points[:, 2:] - 0.5, np.full(count, 1 / count))


def crossed(views: int) -> Samples:
    """A grid of the lens, each with a place of its own in the pixel, as pictures by depth have.

    A sample stands for the open part of its cell of the lens.
    """
    slab = Slab(Camera(2.0, 1.0, 1.0, math.inf), views, 1)  # of a lens of radius 1
    cells = lens_cells(slab, Aperture("circle", 1.0))
    seen = cells.share > 0
    place = crossed_views(slab).displacement[seen]
    return Samples(cells.middle[seen], place, cells.share[seen] / cells.share.sum())


def pictures(
    tracer: Tracer,
    camera: Camera,
    pixels: int,
    points: Samples,
    corners: np.ndarray,
    side: int,
    *,
    subpixels: int = 1,
) -> np.ndarray:
    """(W side, side, 3) float64, linear light in [0, 1]: the mean over lens and pixel.

    Each colour is clipped as the tracer's planes clip it.

    Parameters
    ----------
    corners : (W, 2), first column and row of windows of ``side`` pixels of the picture of
        ``pixels`` a side; they come back one above the other.
    subpixels : parts of a pixel's side, each with a ray of every sample at its ``place``.
    """
    pitch, fine = Slab(camera, 1, pixels).pixel_pitch, Slab(camera, 1, pixels * subpixels)
    lens, many = points.lens * camera.lens_radius_m, side * subpixels
    step = np.array([0.0, 0.0, fine.pixel_pitch, fine.pixel_pitch], np.float32)
    places, found = _grid_places(lens), []
    some = max(1, CHUNK_BYTES // (12 * many * many))
    for corner in corners:
        middle = (corner + (side - 1) / 2 - (pixels - 1) / 2) * pitch
        directions = middle + points.place * fine.pixel_pitch - camera.delta * lens
        elements = np.concatenate([lens, directions], axis=1).astype(np.float32)
        total = np.zeros((many, many, 3))
        for start in range(0, len(elements), some):
            part = slice(start, start + some)
            beams = Bundles(elements[part], step, many, many, fine.pixel_pitch)
            radiance = tracer.bundle_radiance(beams, places[part])
            np.clip(radiance, 0, 1, out=radiance)
            total += np.tensordot(points.weight[part], radiance, 1)
        found.append(total.reshape(side, subpixels, side, subpixels, 3).mean((1, 3)))
    return np.concatenate(found)


def _grid_places(lens: np.ndarray) -> np.ndarray:
    """(K, 2) distinct places on a grid, neighbours near each other: beams are made of them."""
    side = math.ceil(math.sqrt(len(lens)))
    rank = np.empty(len(lens), np.int64)
    rank[np.argsort(lens[:, 0], kind="stable")] = np.arange(len(lens))
    column = rank // side
    row = np.empty(len(lens), np.int64)
    order = np.lexsort((lens[:, 1], column))
    row[order] = np.arange(len(lens)) - np.searchsorted(column[order], column[order])
    return np.stack([column, row], axis=1)
