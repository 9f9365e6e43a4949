"""Scenes from arrays of triangles, for programs that have no file."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from lfcore.errors import SceneError
from lfcore.optics.camera import Camera
from lfcore.scene import framing
from lfcore.scene.assemble import assemble
from lfcore.scene.colour import parse_colour
from lfcore.scene.description import complete
from lfcore.scene.model import Light, Scene
from lfcore.scene.parts import Part, Surface


def scene_from_triangles(
    triangles: ArrayLike,
    *,
    normals: ArrayLike | None = None,
    uvs: ArrayLike | None = None,
    colours: ArrayLike | None = None,
    surface: Surface | None = None,
    camera: Camera | None = None,
    lights: Sequence[Light] | None = None,
    ambient: tuple[float, float, float] | None = None,
    background: tuple[float, float, float] | None = None,
    name: str = "triangles",
) -> Scene:
    """As :meth:`lfcore.scene.model.Scene.from_triangles`."""
    corners = _checked("triangles", triangles, None, 3)
    if not len(corners):
        raise SceneError("the scene is empty: no triangles were given", key="triangles")
    part = Part(
        corners,
        surface or Surface(),
        _checked("normals", normals, len(corners), 3) if normals is not None else None,
        _checked("uvs", uvs, len(corners), 2) if uvs is not None else None,
        _checked("colours", colours, len(corners), 3) if colours is not None else None,
    )
    defaults = complete({"objects": []})
    to_camera = np.eye(4)
    if camera is None:
        camera, to_camera = framing.place_camera(defaults["camera"], [part], file=name)
    geometry = assemble([part], to_camera)
    if not len(geometry.triangles):
        raise SceneError(
            f"the scene is empty: every triangle was dropped ({geometry.dropped})", key="triangles"
        )
    return Scene(
        name=name,
        camera=camera,
        lights=framing.default_lights() if lights is None else list(lights),
        ambient=parse_colour(defaults["ambient"]) if ambient is None else ambient,
        background=parse_colour(defaults["background"]) if background is None else background,
        focus_distances_m=framing.default_focus_distances(camera, geometry.triangles),
        **vars(geometry),
    )


def _checked(key: str, values: ArrayLike, count: int | None, width: int) -> np.ndarray:
    try:
        array = np.asarray(values, np.float64)
    except (TypeError, ValueError) as error:
        raise SceneError(f"are no array of numbers: {error}", key=key) from None
    expected = (len(array) if count is None and array.ndim else count, 3, width)
    if array.shape != expected:
        raise SceneError(f"must be ({count or 'T'}, 3, {width}), not {array.shape}", key=key)
    return array
