"""A thin lens by Monte Carlo integration over lens and film: the assignment's step 4.

Rays leave a lens point drawn by the concentric map and pass the focal point of their film position;
each is looked up quadrilinearly: in the four data cameras around its crossing of the camera
plane, all aimed at the focal point, bilinearly in each.  Rays outside the grid are skipped.
The reference is :func:`lfcore.refocus.array.reference.thin_lens`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lfcore.errors import OpticsError
from lfcore.refocus.array import sampling
from lfcore.refocus.array.device_field import DeviceField
from lfcore.refocus.array.focal_surface import FocalSurface
from lfcore.refocus.array.result import Synthesis
from lfcore.refocus.array.virtual_camera import VirtualCamera


def monte_carlo(
    field: DeviceField,
    camera: VirtualCamera,
    surface: FocalSurface,
    samples_per_pixel: int,
    *,
    sampler: str = "halton",
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Synthesis:
    """Average ``samples_per_pixel`` rays of every pixel.

    Parameters
    ----------
    sampler : ``halton``, ``stratified`` or ``independent``.
    seed : another seed, another noise; the same seed, the same picture to the last bit.
    progress : called with (rows done, rows).

    Returns
    -------
    Synthesis; its ``skipped_share`` is the share of rays that met no data camera.

    Raises
    ------
    OpticsError : no samples, or an unknown sampler.
    """
    code = sampling.sampler_code(sampler)
    if samples_per_pixel < 1:
        raise OpticsError(f"must be at least 1, not {samples_per_pixel}", key="samples_per_pixel")
    table = sampling.halton_table(samples_per_pixel) if code == sampling.HALTON else None
    return thin_lens(field, camera, surface, code, table, samples_per_pixel, seed, progress)


def thin_lens(
    field: DeviceField,
    camera: VirtualCamera,
    surface: FocalSurface,
    sampler: int,
    table: np.ndarray | None,
    count: int,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Synthesis:
    """Run the thin lens kernel with any sampler of :mod:`lfcore.refocus.array.sampling`."""
    kernel = field.kernel("thin_lens.cl", "thin_lens", SAMPLER=sampler)
    empty = np.zeros((0, 4), np.float32)
    table_buffer = field.device.buffer(empty if table is None else table)
    columns, rows = sampling.strata(count)
    arguments = (
        *field.arguments(camera, surface), table_buffer, np.int32(count), np.int32(columns),
        np.int32(rows), np.int32(max(1, (count - 1).bit_length())), np.uint32(seed),
    )  # fmt: skip
    return field.run_rows(kernel, camera, arguments, progress)
