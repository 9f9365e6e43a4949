"""Trace a camera array: every data camera is one element of bundles, its pixels the inner grid."""

from __future__ import annotations

import math

import numpy as np

from lfcore.errors import OpticsError
from lfcore.optics.array import CameraArray
from lfcore.optics.bundles import Bundles
from lfcore.refocus.array.sampling import strata
from lfcore.tracing.tracer import Tracer


def array_bundles(
    array: CameraArray, offsets: np.ndarray | None = None, samples: int = 1
) -> Bundles:
    """All data cameras, row after row, as bundles.

    ``offsets`` (Ny Nx, 2) moves each camera's rays within their pixels, in pixels from the centre.
    ``samples`` a pixel narrow the footprint that textures are filtered over.
    """
    origins = array.origins().reshape(-1, 3)[:, :2]
    tangents = -array.delta * origins
    if offsets is not None:
        tangents = tangents + offsets * array.pixel_pitch
    elements = np.concatenate([origins, tangents], 1).astype(np.float32)
    pitch = array.pixel_pitch
    step = np.array([0.0, 0.0, pitch, pitch], np.float32)
    return Bundles(elements, step, *array.tile, pitch / math.sqrt(samples))


def stratified_offsets(cameras: int, samples: int, seed: int) -> np.ndarray:
    """(samples, cameras, 2) in pixels from the centre: one in each stratum, jittered per camera.

    One sample a pixel is its centre, without jitter.
    """
    if samples == 1:
        return np.zeros((1, cameras, 2))
    columns, rows = strata(samples)
    cell = np.arange(samples)
    corner = np.stack([cell % columns, cell // columns], -1)[:, None]
    jitter = np.random.default_rng(seed).random((samples, cameras, 2))
    return (corner + jitter) / [columns, rows] - 0.5


def trace_array(
    tracer: Tracer,
    array: CameraArray,
    samples_per_pixel: int = 1,
    *,
    seed: int = 0,
) -> np.ndarray:
    """(Ny h, Nx w, 3) float32 linear radiance of all data cameras, not clamped, tiles as
    :class:`CameraArray` lays them out.

    Each camera has its own jitter of ``samples_per_pixel``, its pixels share it, which keeps their
    rays one bundle.
    """
    if samples_per_pixel < 1:
        raise OpticsError(f"must be at least 1, not {samples_per_pixel}", key="samples_per_pixel")
    nx, ny = array.cameras
    grid = np.stack(np.meshgrid(np.arange(nx), np.arange(ny)), -1).reshape(-1, 2)
    offsets = stratified_offsets(nx * ny, samples_per_pixel, seed)
    sets = [array_bundles(array, offset, samples_per_pixel) for offset in offsets]
    image = tracer.mosaic_radiance(sets, grid, nx)
    if samples_per_pixel > 1:
        image /= samples_per_pixel
    return image
