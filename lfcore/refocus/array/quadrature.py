"""A thin lens by a fixed quadrature rule: no noise, the same points in every pixel.

A midpoint rule on the unit square of the lens, taken to the disk by the concentric map (which
keeps areas, so all weights are equal), times a midpoint rule on the pixel.  It is what the
Monte Carlo estimate converges to.
"""

from __future__ import annotations

from collections.abc import Callable

from lfcore.errors import OpticsError
from lfcore.refocus.array import sampling
from lfcore.refocus.array.device_field import DeviceField
from lfcore.refocus.array.focal_surface import FocalSurface
from lfcore.refocus.array.monte_carlo import thin_lens
from lfcore.refocus.array.result import Synthesis
from lfcore.refocus.array.virtual_camera import VirtualCamera


def quadrature(
    field: DeviceField,
    camera: VirtualCamera,
    surface: FocalSurface,
    lens_points: int = 16,
    film_points: int = 2,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> Synthesis:
    """Average over ``lens_points``^2 lens and ``film_points``^2 film midpoints.

    Raises :class:`OpticsError` when either is below 1.
    """
    for key, value in (("lens_points", lens_points), ("film_points", film_points)):
        if value < 1:
            raise OpticsError(f"must be at least 1, not {value}", key=key)
    table = sampling.midpoint_table(film_points, lens_points)
    return thin_lens(
        field, camera, surface, sampling.QUADRATURE, table, len(table), progress=progress
    )
