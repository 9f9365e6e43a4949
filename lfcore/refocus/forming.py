"""The choice among methods and filters that form pictures of a stored light field."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lfcore.errors import OpticsError, check_known
from lfcore.opencl.device import Device
from lfcore.optics.planes import MOST_PLANES, SensorPlane, refuse_lens
from lfcore.optics.size import Pixels
from lfcore.progress import Progress, part_of
from lfcore.refocus.resampling import FILTERS
from lfcore.refocus.shift_sum import shift_sum
from lfcore.refocus.slicing import form_planes
from lfcore.refocus.stored_depth import picture_side, slice_stored
from lfcore.storage.lightfield import LightFieldFile

METHODS = {"slicing": ("bilinear", "shift-sum"), "shift-sum": ("depth", "slicing")}
"""The methods, each with the filter that it lacks and the method that has this filter."""


def form_pictures(
    field: LightFieldFile,
    planes: Sequence[SensorPlane],
    *,
    method: str | None,
    filter: str | None,
    pixels: Pixels | None,
    device: Device | str | None,
    progress: Progress | None,
) -> np.ndarray:
    """As :meth:`lfcore.LightField.refocus_many`."""
    field.require_slab()
    if filter is None:
        by_depth = field.metadata.depth is not None and method in (None, "slicing")
        filter = "depth" if by_depth else "nearest"
    if filter != "depth":
        check_known(OpticsError, "filter", filter, FILTERS)
    method = method or ("shift-sum" if filter == "bilinear" else "slicing")
    check_known(OpticsError, "method", method, METHODS)
    missing, other = METHODS[method]
    if filter == missing:
        remedy = f"Use the method {other}"
        raise OpticsError(f"{method} has no {filter} filter", key="filter", remedy=remedy)
    if not 1 <= len(planes) <= MOST_PLANES:
        remedy = f"Give 1 to {MOST_PLANES} at a time"
        raise OpticsError(f"there are {len(planes)} planes", file=field.path, remedy=remedy)
    if filter == "depth":
        return slice_stored(field, planes, pixels, device=device, progress=progress)
    refuse_lens(planes, f"the filter {filter!r}", "Use the filter depth, of a file with depth")
    if pixels is not None:
        side = picture_side(field, pixels)
        planes = [replace(plane, pixels=side) for plane in planes]
    parts = [field] if field.specular is None else [field, field.specular]
    pictures = np.add.reduce([
        _pictures_of(each, planes, method, filter, device, part_of(progress, number, len(parts)))
        for number, each in enumerate(parts)
    ])  # fmt: skip
    return pictures if field.white == 1.0 else pictures * np.float32(field.white)


def _pictures_of(
    field: LightFieldFile,
    planes: Sequence[SensorPlane],
    method: str,
    filter: str,
    device: Device | str | None,
    progress: Progress | None,
) -> np.ndarray:
    """Pictures of one part of the light, without depth."""
    if method == "shift-sum":
        return shift_sum(field, planes, filter=filter, device=device, progress=progress)
    return form_planes(field, planes, device=device, progress=progress).sums.pictures()
