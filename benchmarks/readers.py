"""Our readers against assimp's: python -m benchmarks.readers --models FOLDER --out FILE.csv

``readers.yaml`` lists public repositories; each is a folder ``owner+name`` in FOLDER.  Both readers
read every model file, in processes of their own with limits of time and memory.
"""

import argparse
import io
import multiprocessing
import os
import re
import resource
import signal
import sysconfig
import zipfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from fnmatch import fnmatch
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
import pandas as pd
import yaml

from benchmarks.results import report, say
from lfcore.colour import srgb_decode
from lfcore.errors import LfcoreError
from lfcore.readers.gltf.animations import Animation
from lfcore.readers.gltf.document import SUFFIXES as GLTF
from lfcore.readers.meshes import read_mesh
from lfcore.readers.side_files import beside
from lfcore.readers.threemf import SUFFIXES as MANUFACTURING
from lfcore.readers.threemf import UNITS
from lfcore.scene.notes import Notebook
from lfcore.scene.surface_mesh import area_vectors, normalise

LIST = Path(__file__).with_suffix(".yaml")
SUFFIXES = (".gltf", ".glb", ".obj", ".ply", ".stl", ".off", ".dae", ".zae", ".3ds", ".3mf")
NO_MATERIALS = (".ply", ".stl", ".off")
"""The formats without materials: each reader has its own default."""
SECONDS = 40
"""The time limit of a reader per file."""
BYTES = 6 << 30
"""The memory limit of a reader per file."""
GREY = (0.8, 0.8, 0.8)
"""Our colour of triangles without a material, linear."""
DEFAULT = 0.6
"""Assimp's, red, green and blue."""
BONE = np.dtype({
    "names": ["count", "weights", "matrix"], "formats": ["u4", "u8", ("f4", (4, 4))],
    "offsets": [1028, 1048, 1056],
})  # fmt: skip
"""The record aiBone of assimp 6, whose fields impasse 5.4 has in another order."""


class Piece(NamedTuple):
    """Triangles (T, 3, 3) of one colour, with a texture (H, W, 3), coordinates, colours and normals
    of their corners."""

    triangles: np.ndarray
    base: Any
    texture: np.ndarray | None = None
    uvs: np.ndarray | None = None
    colours: np.ndarray | None = None
    normals: np.ndarray | None = None


@dataclass(frozen=True)
class Measures:
    """Properties of a file's triangles on which two readers must agree.

    Means are weighted by area.  ``place`` is the mean position; ``volume`` is signed, and so shows
    the winding of faces; ``where``, the mean product of colour and position, shows the places of
    colours; ``normal`` is the mean product of normal and position.
    """

    triangles: int
    low: np.ndarray
    high: np.ndarray
    area: float
    volume: float
    place: np.ndarray
    colour: np.ndarray
    where: np.ndarray
    normal: np.ndarray | None

    def differences(self, other: "Measures") -> dict[str, str]:
        """Return the properties that differ by more than rounding, with both values."""
        size = float(np.linalg.norm(other.high - other.low)) or 1.0
        pairs: dict[str, tuple[Any, Any, float]] = {
            "triangles": (self.triangles, other.triangles, 0.5),
            "bounds": (np.r_[self.low, self.high], np.r_[other.low, other.high], 1e-4 * size),
            "area": (self.area, other.area, 1e-3 * other.area),
            "winding": (self.volume, other.volume, 2e-3 * size * other.area),
            "place": (self.place, other.place, 2e-3 * size),
            "colour": (self.colour, other.colour, 0.01),
            "colours by face": (self.where, other.where, 0.01 * size),
        }
        if self.normal is not None and other.normal is not None:
            pairs["normals"] = self.normal, other.normal, 0.01 * size
        return {
            name: f"{_short(one)} / {_short(two)}" for name, (one, two, most) in pairs.items()
            if not (np.abs(np.subtract(one, two)) <= most).all()
        }  # fmt: skip


def _short(values: Any) -> str:
    return " ".join(f"{value:.4g}" for value in np.ravel(values))


def measured(pieces: list[Piece]) -> Measures | None:
    """Measure all triangles with finite corners and some area; None without any."""
    triangles = np.concatenate([piece.triangles for piece in pieces]).astype(np.float64)
    colours = np.concatenate([colours_of(piece) for piece in pieces])
    normals = None
    given = [piece.normals for piece in pieces if piece.normals is not None]
    if len(given) == len(pieces):
        normals = np.concatenate([np.mean(normalise(corners), 1) for corners in given])
    middle, vectors = triangles.mean(1), area_vectors(triangles)
    areas = np.linalg.norm(vectors, axis=1) / 2
    with np.errstate(invalid="ignore"):
        seen = areas > 1e-10 * np.nanmax(areas, initial=0)
    if not seen.any():
        return None
    triangles, middle, vectors = triangles[seen], middle[seen], vectors[seen]
    low, high = triangles.min((0, 1)), triangles.max((0, 1))
    centre, share = (low + high) / 2, areas[seen] / areas[seen].sum()
    middle = middle - centre
    return Measures(
        int(seen.sum()), low, high, float(areas[seen].sum()),
        float((vectors * middle).sum() / 6), share @ middle,
        share @ colours[seen], (colours[seen] * share[:, None]).T @ middle,
        None if normals is None else (np.nan_to_num(normals[seen]) * share[:, None]).T @ middle,
    )  # fmt: skip


def colours_of(piece: Piece) -> np.ndarray:
    """Return (T, 3) the mean linear colour of each triangle: base x texture x corners."""
    colour = np.broadcast_to(np.asarray(piece.base, np.float64), (len(piece.triangles), 3))
    if piece.colours is not None:
        colour = colour * piece.colours.mean(1)
    if piece.texture is None or piece.uvs is None:
        return colour
    steps = (np.arange(6) + 0.5) / 6
    places = np.array([(a, b) for a in steps for b in steps if a + b < 1.0])
    corners = np.column_stack([1 - places.sum(1), places])
    points = np.einsum("pc,tcx->tpx", corners, np.nan_to_num(piece.uvs[..., :2]))
    height, width = piece.texture.shape[:2]
    texels = np.floor(points % 1.0 * (width, height)).astype(int)
    column, row = np.minimum(texels, (width - 1, height - 1)).transpose(2, 0, 1)
    return colour * srgb_decode(piece.texture[height - 1 - row, column, :3] / 255.0).mean(1)


# -- readers --------------------------------------------------------------------------------------


def ours(file: Path) -> tuple[list[Piece], list[str]]:
    """Read a file by our reader, in its own pose, as assimp does; return the pieces and the
    notes."""
    notebook = Notebook()
    pieces, is_gltf = [], file.suffix.lower() in GLTF
    with patch.object(Animation, "at", return_value={}):
        parts = read_mesh(file, notebook=notebook).parts
    for part in parts:
        surface = part.surface
        unlit = is_gltf and surface.metallic < 0
        base = surface.emission if unlit else surface.diffuse
        if file.suffix.lower() in NO_MATERIALS:
            base = (1, 1, 1)
        texture = surface.emission_texture if unlit else surface.texture
        pieces.append(
            Piece(part.triangles, base, texture, part.uvs, part.colours, part.normals)
        )  # fmt: skip
    return pieces, [f"{note.kind}: {note.what}" for note in notebook.notes()]


def assimps(file: Path) -> tuple[list[Piece], list[str]]:
    """Read a file by assimp; nodes are placed, and meshes are in their pose."""
    prefix = Path(sysconfig.get_path("purelib")) / "cmeel.prefix/lib"
    os.environ["LD_LIBRARY_PATH"] = f"{os.environ.get('LD_LIBRARY_PATH', '')}:{prefix}"
    import impasse
    from impasse.constants import ProcessingStep as Step

    wanted = Step.Triangulate | Step.SortByPType | Step.TransformUVCoords
    scene = impasse.load(str(file), processing=wanted)
    nodes = list(_worlds(scene.root_node, _to_metres(file)))
    world = {node.name: here for node, here in nodes}
    pieces = []
    for node, here in nodes:
        for number in node.struct.mMeshes[0 : node.struct.mNumMeshes]:
            mesh = scene.meshes[number]
            if mesh.struct.mPrimitiveTypes & 4:  # triangles
                pieces.append(_piece(scene, mesh, file, world, here))
    return pieces, []


def _to_metres(file: Path) -> np.ndarray:
    """Return (4, 4) of 3MF's unit and upward axis, which assimp does not apply."""
    if file.suffix.lower() not in MANUFACTURING:
        return np.eye(4)
    with zipfile.ZipFile(file) as archive:
        names = [name for name in archive.namelist() if name.endswith(".model")]
        unit = re.search(rb'<model[^>]*\bunit="(\w+)"', archive.read(names[0]))
    metres = UNITS[unit[1].decode() if unit else "millimeter"]
    return np.diag([metres] * 3 + [1.0]) @ [[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]]


def _worlds(node: Any, above: np.ndarray) -> Iterator[tuple[Any, np.ndarray]]:
    """Yield each node, with its (4, 4) matrix to the world."""
    here = above @ np.array(node.transformation, np.float64)
    yield node, here
    for child in node.children:
        yield from _worlds(child, here)


def _matrices(mesh: Any, world: dict[str, np.ndarray], here: np.ndarray) -> np.ndarray:
    """Return (V, 4, 4) from each vertex to the world, by its bones if the mesh has any."""
    from impasse.structs import ffi

    raw = mesh.struct
    if not raw.mNumBones:
        return np.broadcast_to(here, (raw.mNumVertices, 4, 4))
    sums, shares = np.zeros((raw.mNumVertices, 4, 4)), np.zeros(raw.mNumVertices)
    for bone in mesh.bones:
        head = np.frombuffer(ffi.buffer(bone.struct, BONE.itemsize), BONE)[0]
        data = ffi.buffer(ffi.cast("char *", int(head["weights"])), 8 * int(head["count"]))
        found = np.frombuffer(data, [("vertex", "u4"), ("weight", "f4")])
        to_world = world[bone.name] @ head["matrix"].astype(np.float64)
        np.add.at(sums, found["vertex"], found["weight"][:, None, None] * to_world)
        np.add.at(shares, found["vertex"], found["weight"])
    return sums / np.where(shares, shares, 1.0)[:, None, None]


def _array(pointer: Any, count: int, width: int) -> np.ndarray | None:
    """Return (count, width) float64 of floats in C; None for a null pointer."""
    from impasse.structs import ffi

    if not pointer:
        return None
    data = ffi.buffer(ffi.cast("float *", pointer), 4 * width * count)
    return np.frombuffer(data, np.float32).reshape(-1, width).astype(np.float64)


def _piece(scene: Any, mesh: Any, file: Path, world: dict, here: np.ndarray) -> Piece:
    raw = mesh.struct
    count, suffix = raw.mNumVertices, file.suffix.lower()
    faces = np.array([list(raw.mFaces[k].mIndices[0:3]) for k in range(raw.mNumFaces)])
    points, normals = _array(raw.mVertices, count, 3), _array(raw.mNormals, count, 3)
    assert points is not None  # assimp's meshes have vertices
    whole = points.copy()
    for target in raw.mAnimMeshes[0 : raw.mNumAnimMeshes]:
        moved = _array(target.mVertices, count, 3) if target.mVertices else None
        if moved is not None:
            whole += target.mWeight * (moved - points)
    matrices = _matrices(mesh, world, here)
    points = np.einsum("vij,vj->vi", matrices[:, :3, :3], whole) + matrices[:, :3, 3]
    if normals is not None:
        normals = np.einsum("vji,vj->vi", np.linalg.pinv(matrices[:, :3, :3]), normals)[faces]
    material = scene.materials[raw.mMaterialIndex]
    given = {(p.key, int(p.semantic)): p.data for p in material.properties}
    base = np.array(given.get(("$clr.diffuse", 0), (1, 1, 1)), np.float64)[:3]
    colours, texture, uvs = _array(raw.mColors[0], count, 4), None, None
    if suffix in NO_MATERIALS:
        base = np.ones(3)
    elif suffix not in GLTF and np.allclose(base, DEFAULT) and ("$tex.file", 1) not in given:
        base = np.asarray(GREY) if colours is None else np.ones(3)
    if colours is not None:
        colours = colours[faces][..., :3]
        colours = colours if suffix in GLTF else srgb_decode(np.clip(colours, 0, 1))
    if (name := given.get(("$tex.file", 1))) is not None:
        texture = _texture(scene, name, file)
        uvs = _array(raw.mTextureCoords[int(given.get(("$tex.uvwsrc", 1), 0))], count, 3)
        uvs = None if uvs is None else uvs[faces]
        if suffix == ".obj" and texture is not None and not base.any():
            base = np.ones(3)
    if suffix == ".stl":
        normals = None  # we take them from the order of corners
    return Piece(points[faces], base, texture, uvs, colours, normals)


def _texture(scene: Any, name: str, file: Path) -> np.ndarray | None:
    from PIL import Image

    source: Any = beside(name, file)
    if name.startswith("*"):
        texture = scene.textures[int(name[1:])]
        source = io.BytesIO(bytes(texture.data))
    if source is None:
        return None
    with Image.open(source) as image:
        codes = np.asarray(image)
        if codes.dtype == np.uint16 or image.mode.startswith("I"):
            return np.repeat((codes.astype(np.int64) >> 8).astype(np.uint8)[..., None], 3, -1)
        return np.asarray(image.convert("RGB"))


# -- processes ------------------------------------------------------------------------------------


def tried(read: Callable[[Path], tuple[list[Piece], list[str]]], file: Path) -> tuple:
    """Return measures and notes, or None and the reason."""
    receive, send = multiprocessing.Pipe(duplex=False)
    child = multiprocessing.get_context("fork").Process(target=_child, args=(read, file, send))
    child.start()
    send.close()
    try:
        return receive.recv() if receive.poll(SECONDS) else (None, f"more than {SECONDS} s")
    except EOFError:
        child.join(5)
        number = -(child.exitcode or 0)
        return None, f"crash: {signal.strsignal(number) if number > 0 else child.exitcode}"
    finally:
        child.kill()
        child.join()


def _child(read: Callable, file: Path, send: Any) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
    os.close(2)
    try:
        pieces, notes = read(file)
        found = measured(pieces) if pieces else None
        send.send((found, notes if found else "; ".join(["refused: no triangles", *notes])))
    except LfcoreError as error:
        send.send((None, f"refused: {error}"))
    except BaseException as error:  # impasse's are no Exceptions
        send.send((None, f"traceback: {type(error).__name__}: {error}"))


def row_of(root: Path, file: Path, known: dict) -> dict[str, Any]:
    """Return the result of a file: whether both readers agree, and the reason if they do not.

    ``agrees``; ``noted``: a note of ours names the difference; ``explained``: by the list;
    ``refused`` by our reader; or ``differs``.
    """
    name = file.relative_to(root).as_posix()
    (one, notes), (two, other) = tried(ours, file), tried(assimps, file)
    row = {"file": name, "format": file.suffix.lower()[1:], "other": other if two is None else ""}
    if one is None:
        result = "refused" if notes.startswith("refused") else "fails"
        return row | {"result": result, "reason": notes.replace(f"{root}/", "")}
    row |= {"notes": "; ".join(notes)}
    if two is None:
        reason = _listed(known["unread"], name)
        return row | {"result": "explained" if reason else "alone", "reason": reason}
    apart = one.differences(two)
    row |= {"differences": ", ".join(apart), "values": "; ".join(apart.values())}
    if not apart:
        return row | {"result": "agrees"}
    said = [
        (note, set(measures)) for note in notes for key, measures in known["noted"].items()
        if fnmatch(note, key) and set(measures) & apart.keys()
    ]  # fmt: skip
    if apart.keys() <= set().union(*(measures for _, measures in said)):
        return row | {"result": "noted", "reason": "; ".join(note for note, _ in said)}
    reason = _listed(known["explained"], name)
    return row | {"result": "explained" if reason else "differs", "reason": reason}


def _listed(reasons: dict[str, str], name: str) -> str:
    return next((text for key, text in reasons.items() if fnmatch(name, key)), "")


def files_of(root: Path, repositories: dict[str, list[str]]) -> list[Path]:
    """Return the model files in the folders of all repositories."""
    found = []
    for name, folders in repositories.items():
        for folder in folders:
            inside = root / name.replace("/", "+") / folder
            found += [each for each in inside.rglob("*") if each.suffix.lower() in SUFFIXES]
    return sorted(set(found))


def tables_of(table: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Count files by format and result, and those that do not agree by their reason."""
    counts = table.groupby(["format", "result"]).size().unstack(fill_value=0)
    counts.loc["all"] = counts.sum()
    apart = table[table["result"] != "agrees"].copy()
    apart["reason"] = apart["reason"].fillna("").str.slice(0, 160)
    apart["file"] = apart["file"].str.rpartition("/")[2]
    shown = apart.groupby(["result", "reason"])["file"].agg(["count", "first"]).reset_index()
    return {"": counts.reset_index(), "_reasons": shown}


def main() -> None:
    parser = argparse.ArgumentParser("benchmarks.readers", description=__doc__.splitlines()[0])
    parser.add_argument("--models", type=Path, required=True, help="folder of repositories")
    parser.add_argument("--only", default="*", help="pattern of files' names")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    known = yaml.safe_load(LIST.read_text())
    files = [
        file for file in files_of(options.models, known["repositories"])
        if fnmatch(file.relative_to(options.models).as_posix(), options.only)
    ]  # fmt: skip
    with ThreadPoolExecutor(2) as pool:
        rows = []
        for row in pool.map(lambda file: row_of(options.models, file, known), files):
            rows.append(row)
            say(f"{row['result']}: {row['file']} {row.get('differences', '')}")
    table = pd.DataFrame(rows)
    report(
        options.out, "python -m benchmarks.readers", table, shown=tables_of(table),
        note="Assimp is that of cmeel-assimp {}, through impasse {}.".format(
            version("cmeel-assimp"), version("impasse")
        ),
    )  # fmt: skip


if __name__ == "__main__":
    main()
