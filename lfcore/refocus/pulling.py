"""Pictures of a film whose focus, aperture or point of view are pulled over time."""

from collections.abc import Iterator, Sequence
from dataclasses import fields, replace

import numpy as np

from lfcore.errors import OpticsError
from lfcore.opencl.device import Device
from lfcore.optics.planes import SensorPlane
from lfcore.optics.size import Pixels
from lfcore.progress import Progress
from lfcore.refocus.forming import form_pictures
from lfcore.refocus.free_views import views_at
from lfcore.storage.lightfield import LightFieldFile

Key = tuple[float, SensorPlane | Sequence[float]]
"""A time in seconds with a picture's focus and aperture, or with a point (s, t) of the lens, m."""
PULLED = ("focus_m", "f_number")
"""The fields of planes that may differ between keys."""


def pulled(
    field: LightFieldFile,
    keys: Sequence[Key],
    *,
    filter: str | None,
    pixels: Pixels | None,
    device: Device | str | None,
    progress: Progress | None,
) -> Iterator[np.ndarray]:
    """As :meth:`lfcore.LightField.pull`."""
    times = np.array([time for time, _ in keys], np.float64)
    if not len(times) or not np.isfinite(times).all() or (np.diff(times) <= 0).any():
        raise OpticsError("must have ascending times", file=field.path, key="keys")
    planes = [what for _, what in keys if isinstance(what, SensorPlane)]
    if planes and len(planes) < len(keys):
        problem = "have planes and points of the lens"
        raise OpticsError(problem, file=field.path, key="keys", remedy="Give one kind")
    for name in (each.name for each in fields(SensorPlane)):
        if name not in PULLED and len({getattr(plane, name) for plane in planes}) > 1:
            remedy = "Give every key the same: focus and f-number alone are pulled"
            raise OpticsError(f"differ in {name}", file=field.path, key="keys", remedy=remedy)
    if filter is not None and not planes:
        problem = "is for planes: from a point of the lens, everything is in focus"
        raise OpticsError(problem, key="filter", remedy="Leave it out")
    if planes:
        # Blur is linear in dioptres and in the aperture's diameter.
        values = np.array([(plane.delta, 1 / plane.f_number) for plane in planes])
    else:
        values = np.array([np.asarray(point, np.float64).reshape(2) for _, point in keys])
    for number, time in enumerate(field.times):
        now = field.at(number)
        first, second = (float(np.interp(time, times, column)) for column in values.T)
        if planes:
            focus = 1 / first if first else np.inf
            plane = replace(planes[0], focus_m=focus, f_number=1 / second)
            yield form_pictures(
                now, [plane], method=None, filter=filter, pixels=pixels, device=device,
                progress=None,
            )[0]  # fmt: skip
        else:
            yield views_at(now, np.array([[first, second]]), pixels, device=device)[0]
        if progress:
            progress(number + 1, len(field.times))
