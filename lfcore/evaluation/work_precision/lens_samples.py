"""Pictures through samples of the lens that are not a grid: one beam of rays a lens point."""

from __future__ import annotations

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


def picture(tracer: Tracer, camera: Camera, pixels: int, points: np.ndarray) -> np.ndarray:
    """(M, M, 3) float64, linear light in [0, 1]: the mean over lens ``points`` (K, 2).

    Points are of the unit disk; each colour is clipped as the tracer's planes clip it.
    """
    slab = Slab(camera, 1, pixels)
    lens = np.asarray(points, float) * camera.lens_radius_m
    elements = np.concatenate([lens, -camera.delta * lens], axis=1).astype(np.float32)
    step = np.array([0.0, 0.0, slab.pixel_pitch, slab.pixel_pitch], np.float32)
    total = np.zeros((pixels, pixels, 3))
    some = max(1, CHUNK_BYTES // (12 * pixels * pixels))
    for start in range(0, len(elements), some):
        part = Bundles(elements[start : start + some], step, pixels, pixels, slab.pixel_pitch)
        radiance = tracer.bundle_radiance(part)
        total += np.clip(radiance, 0, 1, out=radiance).sum(axis=0, dtype=np.float64)
    return total / len(elements)
