"""Pictures from a camera array, a function per method.

Each returns a :class:`~lfcore.refocus.array.device_field.Synthesis`, and raises
:class:`OpticsError` for impossible settings.
"""

import math

import numpy as np
import pyopencl as cl

from lfcore.errors import OpticsError, check_known
from lfcore.opencl.interface import record
from lfcore.optics.lens_system import LensSampler, LensSystem
from lfcore.refocus.array import sampling
from lfcore.refocus.array.device_field import GIVEN_RAY, SAMPLING, DeviceField, Synthesis
from lfcore.refocus.array.focal_surface import FocalSurface
from lfcore.refocus.array.virtual_camera import VirtualCamera

BATCH_RAYS = 1 << 20
"""The rays that are traced through a realistic lens at a time."""


def isaksen(
    field: DeviceField, camera: VirtualCamera, surface: FocalSurface, filter_width_m: float
) -> Synthesis:
    """Blend the data cameras within ``filter_width_m`` of each pixel's central ray.

    It is the radius on the camera plane at which the conical filter reaches zero.  The virtual
    camera's lens radius has no effect.

    Source: Isaksen, McMillan, Gortler, "Dynamically Reparameterized Light Fields", SIGGRAPH 2000,
    figure 4; the assignment's step 3.
    """
    if not filter_width_m > 0:
        raise OpticsError(f"must be above 0, not {filter_width_m}", key="filter_width_m")
    arguments = field.arguments(camera, surface)
    return field.run_rows(field.kernel("isaksen"), camera, filter_width=filter_width_m, **arguments)


def monte_carlo(
    field: DeviceField,
    camera: VirtualCamera,
    surface: FocalSurface,
    samples_per_pixel: int,
    *,
    sampler: str = "halton",
    seed: int = 0,
) -> Synthesis:
    """Average ``samples_per_pixel`` rays per pixel over lens and film (step 4).

    A ray goes from a lens point, drawn by the concentric map, to the focal point of its film
    position.  Its radiance is interpolated quadrilinearly: from the four data cameras around its
    intersection with the camera plane, bilinearly at the pixel of each that shows the focal point.
    Rays outside the grid are skipped.  The same seed gives the same picture to the last bit.
    """
    code = _checked(sampler, samples_per_pixel)
    table = sampling.halton_table(samples_per_pixel) if code == sampling.HALTON else None
    return thin_lens(field, camera, surface, code, table, samples_per_pixel, seed)


def quadrature(
    field: DeviceField,
    camera: VirtualCamera,
    surface: FocalSurface,
    lens_points: int = 16,
    film_points: int = 2,
) -> Synthesis:
    """Average over ``lens_points``^2 lens and ``film_points``^2 film midpoints, without noise.

    It is a midpoint rule on the unit square, mapped to the lens by the concentric map.  The map
    preserves areas, so all weights are equal.  Monte Carlo has the same limit.
    """
    for key, value in (("lens_points", lens_points), ("film_points", film_points)):
        if value < 1:
            raise OpticsError(f"must be at least 1, not {value}", key=key)
    table = sampling.midpoint_table(film_points, lens_points)
    return thin_lens(field, camera, surface, sampling.QUADRATURE, table, len(table))


def thin_lens(
    field: DeviceField,
    camera: VirtualCamera,
    surface: FocalSurface,
    sampler: int,
    table: np.ndarray | None,
    count: int,
    seed: int = 0,
) -> Synthesis:
    """Run the thin lens kernel with any sampler of :mod:`lfcore.refocus.array.sampling`."""
    columns, rows = sampling.strata(count)
    samples = record(
        SAMPLING, sampler=sampler, count=count, columns=columns, rows=rows, seed=np.uint32(seed),
        film_bits=max(1, (count - 1).bit_length()),
    )  # fmt: skip
    return field.run_rows(
        field.kernel("thin_lens"), camera, sampling=samples,
        table=None if table is None else field.device.buffer(table),
        **field.arguments(camera, surface),
    )  # fmt: skip


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
) -> Synthesis:
    """Make a picture through a focused realistic lens (the assignment's second bonus).

    Each film sample chooses a point of the exit pupil.  Its ray is traced through the lens in
    float64, and its radiance is interpolated from the data cameras as in :func:`monte_carlo`.  The
    camera's field of view and lens radius have no effect.
    """
    code = _checked(sampler, samples_per_pixel)
    if not film_diagonal_m > 0:
        raise OpticsError(f"must be above 0, not {film_diagonal_m}", key="film_diagonal_m")
    width, height = camera.size
    shooter = LensSampler(lens, film_diagonal_m / 2)
    out, device = np.empty((width * height, 4), np.float32), field.device
    batch = max(1, BATCH_RAYS // samples_per_pixel)
    for first in range(0, len(out), batch):
        part = out[first : first + batch]
        pixels = first + np.arange(len(part))
        rays = film_rays(camera, shooter, pixels, samples_per_pixel, code, seed)
        origins, directions, weights, film = rays
        packed = np.zeros(weights.shape, GIVEN_RAY)
        packed["origin"], packed["direction"] = origins, directions
        packed["weight"], packed["film"] = weights, film
        target = device.empty(part.nbytes)
        field.kernel("given_rays")(
            len(part), grouped=True, rays=device.buffer(packed), count=samples_per_pixel,
            pixels=len(part), out=target, **field.arguments(camera, surface),
        )  # fmt: skip
        cl.enqueue_copy(device.queue, part, target)
    return Synthesis.of(out, camera.size)


def film_rays(
    camera: VirtualCamera,
    lens: LensSampler,
    pixels: np.ndarray,
    count: int,
    sampler: int,
    seed: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The rays of pixels (P,) in array space, float64.

    Returns origins and directions (P, S, 3), weights (P, S) and film positions (P, S, 2) in pixels.
    The camera's position is the middle of the film.  The picture on the film is upside down, and
    is turned back.
    """
    width, height = camera.size
    table = sampling.halton_table(count) if sampler == sampling.HALTON else None
    samples = sampling.pixel_samples(sampler, table, pixels, count, seed)
    corner = np.stack([pixels % width, pixels // width], -1)[:, None]
    film = corner + samples[..., :2]
    pitch = 2 * lens.film_radius_m / math.hypot(width, height)
    place = (np.array([width, height]) / 2 - film) * pitch
    origins, directions, weights = lens.rays(place.reshape(-1, 2), samples[..., 2:].reshape(-1, 2))
    origins = camera.position_m + origins @ camera.rotation.T
    directions = directions @ camera.rotation.T
    shape = (len(pixels), count)
    return origins.reshape(*shape, 3), directions.reshape(*shape, 3), weights.reshape(shape), film


def _checked(sampler: str, samples_per_pixel: int) -> int:
    """The code of a sampler."""
    check_known(OpticsError, "sampler", sampler, sampling.SAMPLERS)
    if samples_per_pixel < 1:
        raise OpticsError(f"must be at least 1, not {samples_per_pixel}", key="samples_per_pixel")
    return sampling.SAMPLERS[sampler]
