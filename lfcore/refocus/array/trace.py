"""Trace a camera array: every data camera is one element of bundles, its pixels the inner grid."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lfcore.errors import OpticsError
from lfcore.optics.array import CameraArray
from lfcore.optics.bundles import Bundles
from lfcore.refocus.array.sampling import strata
from lfcore.tracing.tracer import Tracer

# Traced at a time: few enough that their radiance stays in the cache until it is in its place.
PART_RAYS = 1 << 20


def array_bundles(
    array: CameraArray, offsets: np.ndarray | None = None, samples: int = 1
) -> Bundles:
    """All data cameras, row after row, as bundles.

    ``offsets`` (Ny Nx, 2) moves each camera's rays within their pixels, in pixels from the
    centre.  ``samples`` a pixel narrow the footprint that textures are filtered over; it comes
    from the data camera's own pixel pitch, so it is right up to the borders of its tile.
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
    progress: Callable[[int, int], None] | None = None,
) -> np.ndarray:
    """Linear radiance of all data cameras.

    Parameters
    ----------
    samples_per_pixel : stratified over the pixel; each camera has its own jitter, its pixels
        share it, which keeps their rays one bundle.
    progress : called with (parts of the array done, parts).

    Returns
    -------
    (Ny h, Nx w, 3) float32, not clamped, tiles as :class:`CameraArray` lays them out.

    Raises
    ------
    OpticsError : no samples.
    """
    if samples_per_pixel < 1:
        raise OpticsError(f"must be at least 1, not {samples_per_pixel}", key="samples_per_pixel")
    nx, ny = array.cameras
    width, height = array.tile
    grid = np.stack(np.meshgrid(np.arange(nx), np.arange(ny)), -1).reshape(-1, 2)
    offsets = stratified_offsets(nx * ny, samples_per_pixel, seed)
    sets = [array_bundles(array, offset, samples_per_pixel) for offset in offsets]
    image = np.empty((ny, height, nx, width, 3), np.float32)
    parts = camera_parts(array)
    # Written again and again, so that it stays in the cache.
    most = max(columns.stop - columns.start for _, columns in parts)
    scratch = np.empty((2, most, height, width, 3), np.float32)
    for index, (row, columns) in enumerate(parts):
        part = slice(row * nx + columns.start, row * nx + columns.stop)
        total, light = scratch[:, : part.stop - part.start]
        for number, bundles in enumerate(sets):
            some = replace(bundles, elements=bundles.elements[part])
            tracer.bundle_radiance(some, grid[part], out=light if number else total)
            if number:
                total += light
        if samples_per_pixel > 1:
            total /= samples_per_pixel
        image[row, :, columns] = total.swapaxes(0, 1)
        if progress is not None:
            progress(index + 1, len(parts))
    return image.reshape(ny * height, nx * width, 3)


def camera_parts(array: CameraArray) -> list[tuple[int, slice]]:
    """Rows of cameras cut into pieces that are traced together: (row, columns)."""
    (nx, ny), (width, height) = array.cameras, array.tile
    step = min(nx, max(1, PART_RAYS // (width * height)))
    return [
        (row, slice(first, min(first + step, nx)))
        for row in range(ny)
        for first in range(0, nx, step)
    ]
