"""Public objects that a program makes of arrays, and poses: hostile numbers, shapes and types."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from lfcore import BakedLight, Camera, Light, LightField, Material, Scene, Surface, load_scene
from lfcore.scene.limits import within_limits
from lfcore.tracing.surfaces import with_levels
from robustness.outcome import Outcome, outcome_of
from robustness.sound import check_scene
from robustness.targets import Target
from robustness.trees import damage_json

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
        given = json.loads(data)
    except (ValueError, RecursionError):
        return Outcome("refused")
    if not (isinstance(given, dict) and all(isinstance(one, dict) for one in given.values())):
        return Outcome("refused")

    def make_all() -> None:
        for kind, one in given.items():
            _make(kind, one, folder)

    return outcome_of(make_all, None)


def _make(kind: str, given: dict[str, Any], folder: Path) -> None:
    """What the library makes; keywords that it has not are the caller's fault."""
    if kind == "light":
        light = BakedLight(_array(given, "grids", np.int32), _array(given, "values", np.float32))
        with_levels(light)
    elif kind == "camera":
        keys = given.keys() & {"K", "pose", "pixels", "focus_m", "f_number"}
        Camera.from_matrix(**{"K": None} | {key: given[key] for key in keys})
    elif kind == "place":
        keys = given.keys() & {"position_m", "look_at_m", "matrix", "scale", "zoom"}
        check_scene(load_scene(folder / MESH, bare=True, **{key: given[key] for key in keys}))
    elif kind == "triangles":
        keys = given.keys() & {"normals", "uvs", "colours", "ambient", "name"}
        triangles = given.get("triangles", CORNERS)
        check_scene(Scene.from_triangles(triangles, **{key: given[key] for key in keys}))
    elif kind == "scene":
        _scene(given)
    elif kind == "surface":
        given = {"diffuse": None} | given
        texture = _array(given, "texture", np.uint8)
        Scene.from_triangles(CORNERS, surface=Surface(diffuse=given["diffuse"], texture=texture))
    elif kind == "views":
        given = {"views": None, "spacing": None} | given
        LightField.from_views(given["views"], given["spacing"], folder / "views.mkv")


def _scene(given: dict[str, Any]) -> None:
    empty = np.zeros((0, 3, 3), np.float32)
    listed: dict[str, list[Any]] = {key: _list(given, key)
              for key in ("materials", "lights", "textures")}  # fmt: skip
    made = Scene(
        "a", Camera(0.05, 0.036, 2, 3), np.array(CORNERS, np.float32), empty, empty[..., :2], empty,
        _array(given, "material_ids", np.int32),
        [_of(Material, {"name": "a"}, one) for one in listed["materials"]],
        [_array({"t": one}, "t", np.uint8) for one in listed["textures"]],
        [_of(Light, {"kind": 0, "vector": None, "colour": None}, one) for one in listed["lights"]],
        focus_distances_m=(3.0,),
    )  # fmt: skip
    check_scene(within_limits(made, "a"))


def _of(kind: type, needed: dict[str, Any], one: object) -> Any:
    known = one.items() if isinstance(one, dict) else ()
    fields = kind.__dataclass_fields__  # type: ignore[attr-defined]
    return kind(**needed | {key: value for key, value in known if key in fields})


def _list(given: dict[str, Any], key: str) -> list[Any]:
    """The list of this name, empty where it is something else."""
    value = given.get(key)
    return value if isinstance(value, list) else []


def _array(given: dict[str, Any], key: str, dtype: type) -> Any:
    """The array of a type where the values are such; else what numpy makes of them."""
    try:
        return np.array(given.get(key), dtype)
    except (TypeError, ValueError, OverflowError):
        return given.get(key)


def targets() -> list[Target]:
    return [Target("objects", seeds, damage_json, judge, write_mesh)]
