"""Public objects from arrays and poses: hostile numbers, shapes and types."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from lfcore import BakedLight, Camera, Light, LightField, Material, Scene, Surface, load_scene
from lfcore.scene.limits import within_limits
from lfcore.tracing.surfaces import with_levels
from robustness.inputs import damaged_json
from robustness.outcome import Outcome, outcome_of
from robustness.scene_checks import check_scene
from robustness.targets import Target

CORNERS = [[[-1, -1, 3], [1, -1, 3], [0, 1, 3]], [[-1, -1, 4], [1, -1, 4], [0, 1, 5]]]
POSE = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 9], [0, 0, 0, 1]]
K = [[50, 0, 32], [0, 50, 24], [0, 0, 1]]
SEEDS: tuple[dict[str, Any], ...] = (
    {"light": {"grids": [[0, 0, 2], [6, 6, 1]], "values": [[1, 1, 1]] * 9}},
    {"camera": {"K": K, "pose": POSE, "pixels": [64, 48], "focus_m": 3, "f_number": 2}},
    {"place": {"position_m": [0, 1, 9], "look_at_m": [0, 0, 0], "scale": 0.01}},
    {"place": {"matrix": POSE, "zoom": 2}},
    {"triangles": {"triangles": CORNERS, "normals": CORNERS, "colours": CORNERS,
                   "ambient": [0, 0, 1], "name": "a"}},
    {"scene": {"material_ids": [0, 1], "textures": [[[[255, 0, 0]]]],
               "materials": [{"name": "a", "texture": 0}, {"name": "b", "diffuse": [1, 0, 0]}],
               "lights": [{"kind": 0, "vector": [0, 0, 0], "colour": [1, 1, 1]}]}},
    {"surface": {"diffuse": [1, 0, 0], "texture": [[[255, 0, 0]]]}},
    {"views": {"views": [[[[[0.5, 0.5, 0.5]]]]], "spacing": 0.01}},
)  # fmt: skip
MESH = "input.obj"


def seeds(folder: Path) -> list[bytes]:
    return [json.dumps(seed).encode() for seed in SEEDS]


def write_mesh(folder: Path) -> None:
    (folder / MESH).write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")


def judge(data: bytes, folder: Path) -> Outcome:
    try:
        objects = json.loads(data)
    except (ValueError, RecursionError):
        return Outcome("refused")
    if not isinstance(objects, dict):
        return Outcome("refused")
    if not all(isinstance(arguments, dict) for arguments in objects.values()):
        return Outcome("refused")

    def make_all() -> None:
        for kind, arguments in objects.items():
            _make(kind, arguments, folder)

    return outcome_of(make_all, None)


def _make(kind: str, arguments: dict[str, Any], folder: Path) -> None:
    """Create an object; arguments that its class does not have are left out."""
    if kind == "light":
        grids = _array(arguments, "grids", np.int32)
        with_levels(BakedLight(grids, _array(arguments, "values", np.float32)))
    elif kind == "camera":
        keys = arguments.keys() & {"K", "pose", "pixels", "focus_m", "f_number"}
        Camera.from_matrix(**{"K": None} | {key: arguments[key] for key in keys})
    elif kind == "place":
        keys = arguments.keys() & {"position_m", "look_at_m", "matrix", "scale", "zoom"}
        check_scene(load_scene(folder / MESH, bare=True, **{key: arguments[key] for key in keys}))
    elif kind == "triangles":
        keys = arguments.keys() & {"normals", "uvs", "colours", "ambient", "name"}
        triangles = arguments.get("triangles", CORNERS)
        check_scene(Scene.from_triangles(triangles, **{key: arguments[key] for key in keys}))
    elif kind == "scene":
        _make_scene(arguments)
    elif kind == "surface":
        texture = _array(arguments, "texture", np.uint8)
        diffuse: Any = arguments.get("diffuse")
        surface = Surface(diffuse=diffuse, texture=texture)
        Scene.from_triangles(CORNERS, surface=surface)
    elif kind == "views":
        views: Any = arguments.get("views")
        spacing: Any = arguments.get("spacing")
        LightField.from_views(views, spacing, folder / "views.mkv")


def _make_scene(arguments: dict[str, Any]) -> None:
    empty = np.zeros((0, 3, 3), np.float32)
    light = {"kind": 0, "vector": None, "colour": None}
    scene = Scene(
        "a", Camera(0.05, 0.036, 2, 3), np.array(CORNERS, np.float32), empty, empty[..., :2], empty,
        _array(arguments, "material_ids", np.int32),
        [_record(Material, {"name": "a"}, fields) for fields in _list(arguments, "materials")],
        [_array({"t": texels}, "t", np.uint8) for texels in _list(arguments, "textures")],
        [_record(Light, light, fields) for fields in _list(arguments, "lights")],
        focus_distances_m=(3.0,),
    )  # fmt: skip
    check_scene(within_limits(scene, "a"))


def _record(kind: type, needed: dict[str, Any], fields: object) -> Any:
    """Create a dataclass from ``needed`` and those of ``fields`` that it has."""
    pairs = fields.items() if isinstance(fields, dict) else ()
    known = kind.__dataclass_fields__  # type: ignore[attr-defined]
    return kind(**needed | {key: value for key, value in pairs if key in known})


def _list(arguments: dict[str, Any], key: str) -> list[Any]:
    """Return the list with this name; an empty one if there is none."""
    value = arguments.get(key)
    return value if isinstance(value, list) else []


def _array(arguments: dict[str, Any], key: str, dtype: type) -> Any:
    """Return an array with this type if the values allow, else the value itself."""
    try:
        return np.array(arguments.get(key), dtype)
    except (TypeError, ValueError, OverflowError):
        return arguments.get(key)


def targets() -> list[Target]:
    return [Target("objects", seeds, damaged_json, judge, write_mesh)]
