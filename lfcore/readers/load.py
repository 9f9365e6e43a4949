"""One call from a scene file to the scene that the tracer sees."""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Mapping
from numbers import Integral, Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lfcore.errors import SceneError, check_kind, suggest_keywords
from lfcore.optics.camera import Camera
from lfcore.optics.focus import exclude_twice
from lfcore.optics.size import Pixels, Size
from lfcore.readers.meshes import WITH_AXIS
from lfcore.readers.scene_yaml import build
from lfcore.reading import DESCRIPTIONS, Where, read_yaml
from lfcore.scene import framing
from lfcore.scene.description import check, complete
from lfcore.scene.emitters import POINTS
from lfcore.scene.files import read_scene
from lfcore.scene.limits import within_limits
from lfcore.scene.model import Scene
from lfcore.scene.reflections import with_reflection_notes

EXAMPLE = Path(__file__).parents[1] / "scene" / "example.yaml"
"""The scene that comes with the package; its name is enough."""
PBRT = (".pbrt", ".pbrt.gz")


@suggest_keywords
def load_scene(
    path: str | Path,
    *,
    light_points: int = POINTS,
    up: str | None = None,
    view_from: str | None = None,
    zoom: float | None = None,
    position_m: ArrayLike | None = None,
    look_at_m: ArrayLike | None = None,
    matrix: ArrayLike | None = None,
    camera: Camera | None = None,
    scale: float | None = None,
    light: Mapping[str, Any] | None = None,
    animation: str | None = None,
    bare: bool = False,
    floor: bool | None = None,
    pixels: Pixels = 1,
) -> Scene:
    """Load a scene from any file that describes one.

    Parameters
    ----------
    path : str or Path
        A ``scene.yaml`` or its folder; a mesh (GLB, OBJ, PLY, STL, ...), which gets a camera, a
        sky and a floor where it has none; a ``.pbrt`` file; or a ``scene.npz`` of the workflow;
        or ``"example"``, a scene that comes with the package.
    light_points : int
        Point lights that stand for each area light of a pbrt scene.
    up : str, optional
        ``y`` or ``z``: the upward axis of a mesh; glTF's is y.  Default: y, with a note in the
        scene where z seems to be up.
    view_from : str, optional
        The side that a mesh is seen from: ``"front"`` (+z), ``"back"``, ``"left"``, ``"right"``,
        ``"top"``, or azimuth and elevation in degrees such as ``"30,20"``.
    zoom : float, optional
        Above 1, a narrower field of view from the same place.
    position_m, look_at_m : array_like, optional
        (3,) metres in world space, y up: the lens, and a point in the middle of the picture.
    matrix : array_like, optional
        (4, 4) camera to world, instead of the two; see :class:`lfcore.Camera`'s ``pose``.
    camera : Camera, optional
        The lens, and its pose if it has one: see :meth:`lfcore.Camera.from_matrix`.
    scale : float, optional
        Metres per unit of a mesh file, 0.001 of one in millimetres.
    light : mapping, optional
        Keys of a scene.yaml in place of the file's: ``sky``, ``bounces``, ``bake_error``,
        ``bake_cells``, ``bake_mib``.  A file is relative to the scene's.
    animation : str, optional
        The animation of a glTF file to play.  Default: its first.
    bare : bool
        Leave a mesh without sky and floor, lit by two lights.  So it is with ``light``, too, and
        where it has lights of its own or the camera is within it.
    floor : bool, optional
        Put a floor under the scene, as one of its things, or leave out the one under a mesh, which
        is no part of ``materials`` and ``depth_range``; ``floor`` and ``studio`` of a scene.yaml.
    pixels : int or (int, int)
        The width and height of the pictures where they differ, for a camera that frames the scene.

    Returns
    -------
    Scene
        Its ``notes`` say what a foreign format has that could not be mapped exactly.

    Raises
    ------
    SceneError
        The file is missing or damaged, or describes no scene.

    Examples
    --------
    >>> scene = lfcore.load_scene("ball.obj", view_from="30,20", bare=True)
    >>> scene.name, scene.triangle_count
    ('ball', 80)
    """
    path = Path(path)
    if path == Path(EXAMPLE.stem) and not path.exists():
        path = EXAMPLE
    check_kind(camera, Camera | None, "camera", "a Camera")
    check_kind(floor, bool | None, "floor", "True or False")
    pose = {"position_m": position_m, "look_at_m": look_at_m, "matrix": matrix}
    view = {**pose, "camera": camera, "view_from": view_from, "zoom": zoom, "scale": scale}
    if path.suffix.lower() == ".npz":
        _refuse_view(path, **view, light=light, up=up)
        _refuse_of_objects(path, floor=floor, animation=animation)
        return read_scene(path)
    if light is not None:
        check_kind(light, Mapping, "light")
    if not isinstance(light_points, Integral) or light_points < 1:
        raise SceneError(f"must be a whole number, not {light_points!r}", key="light_points")
    if path.is_dir():
        path = path / "scene.yaml"
    _check_up(up, path)
    if path.name.lower().endswith(PBRT):
        _refuse_view(path, **view, light=light)
        _refuse_of_objects(path, floor=floor, animation=animation)
        return _pbrt(path, int(light_points))
    mesh = path.suffix.lower() not in DESCRIPTIONS
    if mesh:
        description, name = _of_mesh(path, animation, up, scale), path.stem
    else:
        for key, value in {"scale": scale, "animation": animation}.items():
            if value is not None:
                remedy = "Give it to the object in the file, a scale as transform: [{scale: ...}]"
                raise Where(path, key).error("belongs to a mesh file", remedy)
        description = complete(check(read_yaml(path), file=path))
        own = path.resolve().parent.name if path.stem == "scene" else path.stem
        name = description.get("name") or own or "scene"
    if floor is not None:
        description["floor"] = floor
    if bare:
        description.pop("studio", None)
    if light:
        description = complete(check({**description, **light}, file=path))
    description = _placed(description, path, pose, camera, view_from, zoom)
    lens = description["camera"]
    if view_from is not None:
        if "pose" in lens:
            _refuse_view(path, view_from=view_from)
        lens["view_from"] = view_from
    if zoom is not None:
        if not isinstance(zoom, Real):
            raise SceneError(f"must be a number, not {zoom!r}", key="zoom")
        lens["zoom"] *= zoom
    note_up = mesh and up is None and path.suffix.lower() not in WITH_AXIS
    alone = mesh and not bare and not light
    return build(
        description, file=path, name=name, note_up=note_up, alone=alone, lens=camera,
        size=Size.of(pixels),
    )  # fmt: skip


def _of_mesh(path: Path, animation: str | None, up: str | None, scale: float | None) -> dict:
    """The description of a scene that is one mesh file."""
    if not os.path.isfile(path):
        raise Where(path).error("file not found, or no regular file", "Check the path")
    entry: dict = {"file": path.name}
    if animation is not None:
        entry["animation"] = animation
    if up == "z":
        entry["transform"] = [{"rotate": {"axis": "x", "angle_deg": -90}}]
    if scale is not None:
        if not (isinstance(scale, Real) and 0 < scale < math.inf):
            raise SceneError(f"must be a number above 0, not {scale!r}", key="scale")
        entry.setdefault("transform", []).append({"scale": float(scale)})
    return complete({"objects": [entry]})


def _placed(
    description: dict,
    file: Path,
    pose: dict[str, Any],
    camera: Camera | None,
    view_from: str | None,
    zoom: float | None,
) -> dict:
    """A completed description with the caller's pose of the camera."""
    if camera is not None:
        exclude_twice(camera=camera, zoom=zoom)
        if "lightfield" in description["camera"]:
            _refuse_view(file, camera=camera)
        if camera.pose is not None:
            exclude_twice(camera=camera, **pose, view_from=view_from)
            pose = {"matrix": camera.pose}
    pose_keys = {key: _plain(key, value) for key, value in pose.items() if value is not None}
    if not pose_keys:
        return description
    for key in pose_keys:
        exclude_twice(**{key: pose_keys, "view_from": view_from})
    lens = {key: value for key, value in description["camera"].items() if key != "view_from"}
    if "matrix" not in pose_keys:
        file_pose = lens.get("pose", {})
        pose_keys = {key: file_pose[key] for key in file_pose if key != "matrix"} | pose_keys
    return complete(check({**description, "camera": {**lens, "pose": pose_keys}}, file=file))


def _plain(key: str, values: ArrayLike) -> list:
    """Numbers of an array as the lists that a scene.yaml has."""
    try:
        return np.asarray(values, np.float64).tolist()
    except (TypeError, ValueError, OverflowError):
        raise SceneError("must be an array of numbers", key=key) from None


def _refuse_view(path: Path, **settings: Any) -> None:
    for key, value in settings.items():
        if value is not None:
            remedy = "Leave it out, or change the camera in the file"
            raise Where(path, key).error("the scene has its own camera", remedy)


def _refuse_of_objects(path: Path, **settings: Any) -> None:
    for key, value in settings.items():
        if value is not None:
            raise Where(path, key).error("belongs to a mesh or a scene.yaml", "Leave it out")


def _check_up(up: str | None, path: Path) -> None:
    where = Where(path, "up")
    if up not in ("y", "z", None):
        raise where.error(f"{up!r} is no axis", "Give y or z")
    scene = path.name.lower().endswith(PBRT) or path.suffix.lower() in DESCRIPTIONS
    if up == "z" and (scene or path.suffix.lower() in WITH_AXIS):
        remedy = "Leave the option out; a scene.yaml may turn an object by its transform"
        raise where.error("the file says by itself where up is", remedy)


def _pbrt(path: Path, light_points: int) -> Scene:
    from lfcore.readers.pbrt.build import build_pbrt_scene  # a package of its own, seldom needed

    scene = with_reflection_notes(build_pbrt_scene(path, light_points=light_points), path)
    distances = framing.default_focus_distances(scene.camera, scene.triangles)
    return within_limits(dataclasses.replace(scene, focus_distances_m=distances), path)
