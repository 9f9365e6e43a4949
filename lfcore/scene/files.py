"""A scene on disk: one npz of plain arrays with a JSON header, no pickles."""

import hashlib
import io
import json
import math
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.errors import SceneError
from lfcore.files import read_arrays, whole_file
from lfcore.optics.camera import Camera
from lfcore.scene.appearance import LATER, POINT, Light, Material
from lfcore.scene.baked import NO_SKY, BakeOptions
from lfcore.scene.model import Scene
from lfcore.scene.motion import Motion
from lfcore.scene.notes import Note
from lfcore.scene.view import View

FORMAT = "lfcore scene 3"
ARRAYS = {
    "triangles": (np.float32, (3, 3)),
    "normals": (np.float32, (3, 3)),
    "uvs": (np.float32, (3, 2)),
    "colours": (np.float32, (3, 3)),
    "material_ids": (np.int32, ()),
}
NO_LIGHT = Light(POINT, (0, 0, 0), (0, 0, 0))
PLAIN = "name", "ambient", "background", "clip", "dropped", "focus_distances_m"
"""The attributes of a scene that are in the header as they are."""


def save_scene(path: str | Path, scene: Scene) -> None:
    """Write ``scene``; equal scenes give equal bytes. The file appears only when whole."""
    with whole_file(path) as file:
        _write(file, scene)


def scene_digest(scene: Scene) -> str:
    """The SHA-256, in hex, of the file that :func:`save_scene` writes.

    Equal scenes have equal digests, with and without baked light, also by another path: notes name
    files.
    """
    stream = io.BytesIO()
    _write(stream, replace(scene, light=None, notes=()))
    return hashlib.sha256(stream.getbuffer()).hexdigest()


def _write(file: Any, scene: Scene) -> None:
    arrays = {name: np.ascontiguousarray(getattr(scene, name), ARRAYS[name][0]) for name in ARRAYS}
    for index, texture in enumerate(scene.textures):
        arrays[f"texture_{index:04d}"] = np.ascontiguousarray(texture, np.uint8)
    if len(scene.sky):
        arrays["sky"] = np.ascontiguousarray(scene.sky, np.float32)
    header = json.dumps(_header(scene), sort_keys=True).encode()
    named: dict[str, Any] = {"header": np.frombuffer(header, np.uint8), **arrays}
    np.savez(file, **named)


def _header(scene: Scene) -> dict:
    camera = scene.camera.to_json()
    if math.isinf(scene.camera.focus_m):
        camera["focus_distance_m"] = "infinity"  # JSON has no infinity
    return {
        "format": FORMAT,
        **{name: getattr(scene, name) for name in PLAIN},
        "camera": camera,
        "materials": [_json(material, Material("")) for material in scene.every_material],
        "textures": len(scene.textures),
        "lights": [_json(light, NO_LIGHT) for light in scene.lights],
        "triangles": scene.triangle_count,
        "view": scene.view.to_json() if scene.view else None,
        "motions": [
            [motion.first, motion.count, motion.start.tolist(), motion.end.tolist()]
            for motion in scene.motions
        ],
        "notes": [[note.kind, str(note.file), note.line, note.what] for note in scene.notes],
        **({"bake": asdict(scene.bake)} if scene.bake else {}),
        **({"floor": True} if scene.floor else {}),
    }


def _json(item: Material | Light, default: Material | Light) -> dict:
    """The fields of an item, without the defaults of those that earlier files lack."""
    return {
        key: value
        for key, value in asdict(item).items()
        if key not in LATER or value != getattr(default, key)
    }


def read_header(path: str | Path) -> dict:
    """The JSON header alone (name, camera, ...), without loading the arrays."""
    return _read(path, _parse_header)


def read_scene(path: str | Path) -> Scene:
    """Inverse of :func:`save_scene`."""
    return _read(path, _scene)


def _read(path: str | Path, read: Callable[[Any], Any]) -> Any:
    remedy = "Delete it and parse the scene again"
    return read_arrays(path, "scene file", read, kind=SceneError, remedy=remedy)


def _parse_header(archive: Any) -> dict:
    header = json.loads(archive["header"].tobytes())
    if header.get("format") != FORMAT:
        raise ValueError(f"format {header.get('format')!r} instead of {FORMAT!r}")
    return header


def _scene(archive: Any) -> Scene:
    header = _parse_header(archive)
    arrays = {name: archive[name] for name in ARRAYS}
    for name, (dtype, shape) in ARRAYS.items():
        array = arrays[name]
        count, every = header["triangles"], name in ("triangles", "material_ids")
        lengths = (count,) if every else (0, count)
        if array.dtype != dtype or array.shape[1:] != shape or len(array) not in lengths:
            raise ValueError(f"array {name!r} is {array.dtype} {array.shape}")
    materials = [Material(**_tuples(material)) for material in header["materials"]]
    return Scene(
        **_tuples({name: header[name] for name in PLAIN}),
        camera=Camera.from_json(header["camera"]),
        floor=materials.pop() if "floor" in header else None,
        materials=materials,
        textures=[archive[f"texture_{index:04d}"] for index in range(header["textures"])],
        lights=[Light(**_tuples(light)) for light in header["lights"]],
        view=View.from_json(header["view"]) if header["view"] else None,
        motions=tuple(
            Motion(first, count, np.array(start), np.array(end))
            for first, count, start, end in header["motions"]
        ),
        notes=tuple(
            Note(kind, Path(file), line, what) for kind, file, line, what in header["notes"]
        ),
        sky=archive["sky"] if "sky" in archive else NO_SKY,
        bake=BakeOptions(**header["bake"]) if "bake" in header else None,
        **arrays,
    )


def _tuples(data: dict) -> dict:
    return {key: tuple(value) if isinstance(value, list) else value for key, value in data.items()}
