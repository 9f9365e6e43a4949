"""Scenes from arrays in memory, with the defaults of a mesh file."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lfcore.errors import SceneError, check_kind
from lfcore.optics.camera import Camera
from lfcore.reading import Where
from lfcore.scene import framing
from lfcore.scene.appearance import Light
from lfcore.scene.assemble import assemble
from lfcore.scene.description import complete
from lfcore.scene.limits import within_limits
from lfcore.scene.model import Scene
from lfcore.scene.surface_mesh import SurfaceMesh, parse_colour
from lfcore.scene.transforms import pose_from_matrix


def scene_of_parts(
    parts: list[SurfaceMesh],
    name: str,
    camera: Camera | None,
    lights: Sequence[Light] | None,
    **light: tuple[float, float, float] | None,
) -> Scene:
    """Assemble meshes to a scene; None gives the default of a mesh file.

    Without a camera, one is placed that sees all parts.  ``light`` has ``ambient`` and
    ``background``.
    """
    check_kind(camera, Camera | None, "camera", "a Camera")
    defaults, to_camera = complete({"objects": []}), np.eye(4)
    if camera is None:
        extent = framing.bounds(parts, file=name)
        camera, to_camera = framing.place_camera(defaults["camera"], extent, Where(name))
    elif camera.pose is not None:
        to_camera = pose_from_matrix(camera.pose, Where("", "camera.pose"))
        camera = replace(camera, pose=None)
    geometry = assemble(parts, to_camera)
    geometry.refuse_none(Where("", "triangles"))
    around: dict[str, Any] = {
        key: parse_colour(defaults[key]) if value is None else value for key, value in light.items()
    }
    scene = Scene(
        name=name,
        camera=camera,
        lights=framing.default_lights() if lights is None else list(lights),
        focus_distances_m=framing.default_focus_distances(camera, geometry.triangles),
        **around,
        **geometry.arrays,
    )
    return within_limits(scene, name)


def corner_values(key: str, values: ArrayLike, count: int | None, width: int) -> np.ndarray:
    """Return (count, 3, width) float64; raise :class:`SceneError` for another shape."""
    try:
        array = np.asarray(values, np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise SceneError(f"are no array of numbers: {error}", key=key) from None
    expected = (len(array) if count is None and array.ndim else count, 3, width)
    if array.shape != expected:
        raise SceneError(f"must be ({count or 'T'}, 3, {width}), not {array.shape}", key=key)
    return array
