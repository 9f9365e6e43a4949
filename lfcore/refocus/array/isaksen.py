"""Isaksen's reconstruction: few look-ups, a cone filter instead of a lens.

Isaksen, McMillan, Gortler, "Dynamically Reparameterized Light Fields", SIGGRAPH 2000, figure 4; the
assignment's step 3.  The reference is :func:`lfcore.refocus.array.reference.isaksen`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lfcore.errors import OpticsError
from lfcore.refocus.array.device_field import DeviceField
from lfcore.refocus.array.focal_surface import FocalSurface
from lfcore.refocus.array.result import Synthesis
from lfcore.refocus.array.virtual_camera import VirtualCamera


def isaksen(
    field: DeviceField,
    camera: VirtualCamera,
    surface: FocalSurface,
    filter_width_m: float,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> Synthesis:
    """Blend the data cameras within ``filter_width_m`` of each pixel's central ray.

    Parameters
    ----------
    filter_width_m : radius, on the camera plane, at which the cone reaches zero.  0 is a closed
        filter: the nearest data camera alone.  ``camera.lens_radius_m`` plays no part.
    progress : called with (rows done, rows).

    Returns
    -------
    Synthesis; pixels near which no data camera stands, or whose focal point none sees, have
    coverage 0.

    Raises
    ------
    OpticsError : a negative filter.
    """
    if not filter_width_m >= 0:
        raise OpticsError(f"must not be {filter_width_m}", key="filter_width_m")
    kernel = field.kernel("isaksen.cl", "isaksen")
    arguments = (*field.arguments(camera, surface), np.float32(filter_width_m))
    return field.run_rows(kernel, camera, arguments, progress)
