"""A realistic lens instead of a thin one: the assignment's second bonus.

Every film sample draws a point of the exit pupil; the ray is traced through the glass in float64
and then looked up in the camera array, weighted as :class:`~lfcore.optics.lens_system.LensSampler`
says.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pyopencl as cl

from lfcore.errors import OpticsError
from lfcore.optics.lens_system import LensSampler, LensSystem
from lfcore.refocus.array import sampling
from lfcore.refocus.array.device_field import DeviceField
from lfcore.refocus.array.focal_surface import FocalSurface
from lfcore.refocus.array.result import Synthesis
from lfcore.refocus.array.virtual_camera import VirtualCamera

if TYPE_CHECKING:
    pass

_BATCH_RAYS = 1 << 20


def film_rays(
    camera: VirtualCamera,
    lens: LensSampler,
    pixels: np.ndarray,
    count: int,
    sampler: int,
    seed: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rays of ``pixels`` (P,) in array space.

    The camera's position is the middle of the film; the picture on the film stands upside down
    and is turned back.  Returns origins and directions (P, S, 3), weights (P, S) and film
    positions in pixels (P, S, 2), float64.
    """
    width, height = camera.size
    table = sampling.halton_table(count) if sampler == sampling.HALTON else None
    samples = sampling.pixel_samples(sampler, table, pixels, count, seed)
    corner = np.stack([pixels % width, pixels // width], -1)[:, None]
    film = corner + samples[..., :2]
    pitch = 2 * lens.film_radius_m / math.hypot(width, height)
    place = (np.array([width, height]) / 2 - film) * pitch
    origins, directions, weights = lens.rays(place.reshape(-1, 2), samples[..., 2:].reshape(-1, 2))
    shape = (len(pixels), count)
    origins = camera.position_m + origins @ camera.rotation.T
    directions = directions @ camera.rotation.T
    return (
        origins.reshape(*shape, 3),
        directions.reshape(*shape, 3),
        weights.reshape(shape),
        film,
    )


def realistic(
    field: DeviceField,
    camera: VirtualCamera,
    lens: LensSystem,
    surface: FocalSurface,
    samples_per_pixel: int,
    *,
    film_diagonal_m: float = 0.035,
    sampler: str = "halton",
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Synthesis:
    """A picture through ``lens``, already focused (:meth:`LensSystem.focused`).

    Parameters
    ----------
    camera : pose and size; its field of view and lens radius play no part.
    surface : where the data cameras are aimed at; the plane of focus gives the sharpest picture.

    Raises
    ------
    OpticsError : no samples, an unknown sampler, a lens that lets nothing through.
    """
    code = sampling.sampler_code(sampler)
    if samples_per_pixel < 1:
        raise OpticsError(f"must be at least 1, not {samples_per_pixel}", key="samples_per_pixel")
    if not film_diagonal_m > 0:
        raise OpticsError(f"must be above 0, not {film_diagonal_m}", key="film_diagonal_m")
    width, height = camera.size
    kernel = field.kernel("rays.cl", "given_rays")
    start = field.arguments(camera, surface)
    shooter = LensSampler(lens, film_diagonal_m / 2)
    out = np.empty((width * height, 4), np.float32)
    batch = max(1, _BATCH_RAYS // samples_per_pixel)
    for first in range(0, len(out), batch):
        pixels = np.arange(first, min(first + batch, len(out)))
        rays = film_rays(camera, shooter, pixels, samples_per_pixel, code, seed)
        out[pixels] = _look_up(field, kernel, start, rays)
        if progress is not None:
            progress(int(pixels[-1]) + 1, len(out))
    picture = out.reshape(height, width, 4)
    return Synthesis(np.ascontiguousarray(picture[..., :3]), picture[..., 3].copy())


def _look_up(
    field: DeviceField, kernel: cl.Kernel, start: tuple[Any, ...], rays: tuple[np.ndarray, ...]
) -> np.ndarray:
    origins, directions, weights, film = rays
    pixels, count = weights.shape
    packed = np.zeros((pixels, count, 8), np.float32)
    packed[..., :3], packed[..., 3:6], packed[..., 6] = origins, directions, weights
    device = field.device
    result = np.empty((pixels, 4), np.float32)
    target = device.empty(result.nbytes)
    buffers = device.buffer(packed), device.buffer(film.astype(np.float32))
    kernel(
        device.queue, (pixels,), None, *start, *buffers, np.int32(count), np.int32(pixels), target
    )
    cl.enqueue_copy(device.queue, result, target)
    return result
