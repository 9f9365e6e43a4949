"""What a caller leaves out: the planes, the lattice and the lens of pictures and light fields."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from lfcore.errors import OpticsError, check_kind, check_known
from lfcore.optics.camera import Camera
from lfcore.optics.focus import exclude_twice
from lfcore.optics.planes import SensorPlane
from lfcore.optics.size import Pixels, Size, whole_number
from lfcore.optics.slab import Lattice, Slab
from lfcore.rendering.direct import focused_camera
from lfcore.scene.model import Scene

FILTERS = ("depth", "nearest")
VIEWS = 16
"""The default lens samples per side without depth: those of the thesis's tables."""


def chosen_planes(
    scene: Scene, planes: Sequence[SensorPlane] | None, size: Size, **lens: Any
) -> tuple[list[SensorPlane], Camera]:
    """The planes, and the scene's camera, which is opened as wide as any plane needs.

    ``lens`` has the settings of :meth:`Scene.plane` that :func:`render` takes.
    """
    if planes is None:
        planes = [scene.plane(pixels=size, **lens)]
    else:
        for name, value in lens.items():
            is_default = name == "aperture" and value == "circle"
            exclude_twice(**{name: None if is_default else value, "planes": planes})
    check_kind(planes, Sequence, "planes", "a sequence of SensorPlanes")
    if not planes:
        raise OpticsError("there are no planes", key="planes")
    for plane in planes:
        check_kind(plane, SensorPlane, "planes")
    widest = min(plane.f_number for plane in planes)
    camera = replace(scene.camera, f_number=min(widest, scene.camera.f_number))
    for plane in planes:
        plane.check(Slab(camera, 1, 1))
        plane.lens_aperture(Slab(camera, 1, 1))
    return list(planes), camera


def recorded_lens(
    scene: Scene,
    pixels: Pixels,
    focus_m: float | str | None = None,
    f_number: float | None = None,
    *,
    focus_at: Sequence[float] | None = None,
    blur: float | str | None = None,
) -> tuple[Scene, Camera, dict[str, Any]]:
    """The scene, the camera that :func:`record` traces, and the file's note on its lens.

    A pinhole camera gets a fitted lens unless an aperture is given.  The field of view stays.
    """
    content = {}
    if f_number is None and blur is None and scene.is_pinhole:
        scene, content = scene.with_lens(), {"lens": "fitted: the scene's camera is a pinhole"}
    plane = scene.plane(focus_m, f_number, focus_at=focus_at, blur=blur, pixels=pixels)
    camera = focused_camera(scene.camera, plane)
    if not math.isfinite(camera.field_width):
        raise OpticsError("the picture has no extent", key="focus_m")
    return scene, camera, content


def lattice_to_trace(filter: str, views: int | Lattice | None) -> Lattice:
    """The lattice that :func:`render` traces."""
    check_known(OpticsError, "filter", filter, FILTERS)
    if filter == "depth":
        return views if isinstance(views, Lattice) else Lattice(4 if views is None else views)
    remedy = "Give a Lattice with displaced=False"
    return _plain(views, "the filter 'nearest' takes views that are not displaced", remedy)


def lattice_to_store(depth: bool | None, views: int | Lattice | None) -> tuple[bool, Lattice]:
    """Whether :func:`lfcore.record` stores depth, and the lattice that it traces."""
    if depth is not False:
        if isinstance(views, Lattice):
            return True, views
        # Views between 4 x 4 stored ones reach 36 to 47 dB; 6 x 6 add only 0.7 dB.
        provided = whole_number("views", 4 if views is None else views, 4096)
        return True, Lattice(max(4, math.isqrt(provided)))
    remedy = "Store depth, or give a Lattice with displaced=False"
    return False, _plain(views, "displaced views need their depths", remedy)


def _plain(views: int | Lattice | None, problem: str, remedy: str) -> Lattice:
    """A lattice without displaced views, by default with one ray per pixel."""
    if not isinstance(views, Lattice):
        return Lattice(VIEWS if views is None else views, 1, displaced=False)
    if views.displaced:
        raise OpticsError(problem, key="views", remedy=remedy)
    return views
