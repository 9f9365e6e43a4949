"""Wavefront OBJ: polygons with texture coordinates, normals, colours and materials.

Source: Wavefront Technologies, "The Advanced Visualizer", appendix B1.  Colours behind a vertex's
coordinates are the convention of MeshLab and ZBrush; they are display values.
"""

from pathlib import Path

import numpy as np

from lfcore.colour import srgb_decode
from lfcore.readers.account import Account
from lfcore.readers.mtl import Libraries
from lfcore.readers.polygons import triangulate
from lfcore.readers.text import Statements, numbers, rows, words_of
from lfcore.scene.notes import LEFT_OUT, NOT_USED, Notebook
from lfcore.scene.surface_mesh import SurfaceMesh

PER_CORNER = ("vertices", "texture coordinates", "normals")
NAMES = ("o", "g")
"""Statements that name parts of the file; they change no picture."""
CURVED = (
    "cstype", "deg", "bmat", "step", "parm", "trim", "hole", "scrv", "sp", "end", "con", "curv",
    "curv2", "surf", "vp", "ctech", "stech",
)  # fmt: skip
"""Statements of curves and surfaces that are no polygons."""


def read_obj(data: bytes, path: Path, notebook: Notebook, account: Account) -> list[SurfaceMesh]:
    """The parts of an OBJ file, one per material; normals are those of the file."""
    statements = Statements(data, ("v", "vt", "vn", "f"))
    libraries = Libraries(path, notebook, account)
    switches = _switches(statements, libraries, account)
    if b"#MRGB" in statements.text:
        notebook.add(NOT_USED, path, "colours of vertices in comments '#MRGB'")
    mesh = _Polygons(statements, account)
    faces = statements.lines("f")[mesh.polygons]
    lines, names = zip(*switches, strict=True)
    number_of = {name: number for number, name in enumerate(dict.fromkeys(names))}
    numbers_of = np.array([number_of[name] for name in names])
    material = numbers_of[np.searchsorted(lines, faces, side="right") - 1]
    order = np.argsort(material, kind="stable")
    ends = np.cumsum(np.bincount(material, minlength=len(number_of)))
    parts = []
    for name, start, end in zip(number_of, [0, *ends[:-1].tolist()], ends.tolist(), strict=True):
        if start < end:
            chosen = order[start:end] if end - start < len(faces) else slice(None)
            parts.append(libraries.surface(name).placed(mesh.part(chosen)))
    libraries.close()
    return parts


def _switches(
    statements: Statements, libraries: Libraries, account: Account
) -> list[tuple[int, str]]:
    """The lines at which materials begin, and their names; other statements are counted."""
    switches, understood = [(-1, "")], set(NAMES)
    if len(statements.lines("vn")):
        understood.add("s")  # the file's normals replace smoothing groups
    for line, word, rest in statements.others():
        if word == "usemtl":
            switches.append((line, rest))
        elif word == "mtllib":
            libraries.add(rest)
        else:
            things = f"statements '{word}'" if word.isprintable() else "statements of no words"
            account.hold(things)
            if word in understood:
                account.use(things)
            elif word in CURVED:
                account.lose(things, LEFT_OUT, "curves and curved surfaces")
    return switches


class _Polygons:
    """The triangles of all faces: ``polygons`` (T,), the face of each, and what corners have."""

    def __init__(self, statements: Statements, account: Account):
        values, counts = statements.numbers("v")
        if len(counts) and counts.min() < 3:
            raise ValueError(f"a vertex has {counts.min()} coordinates")
        self.points = rows(values, counts, 3, 0.0)
        self.colours = self._colours(values, counts, account)
        tables_read = [statements.numbers(word) for word in ("vt", "vn")]
        self.uvs, self.normals = rows(*tables_read[0], 2, 0.0), rows(*tables_read[1], 3, 0.0)
        if tables_read[0][1].max(initial=0) > 2 and rows(*tables_read[0], 3, 0.0)[:, 2].any():
            account.hold("third texture coordinates", int((tables_read[0][1] > 2).sum()))
        tables = self.points, self.uvs, self.normals
        for name, table in zip(PER_CORNER, tables, strict=True):
            account.hold(name, len(table))
            account.use(name, len(table))  # unused ones are not searched for
        corners, counts = _corners(statements.body("f"))
        self._absolute(corners, counts, statements, tables, account)
        self._triangles, self.polygons = triangulate(self.points, corners[:, 0], counts, account)
        self._corners = corners

    @staticmethod
    def _colours(values: np.ndarray, counts: np.ndarray, account: Account) -> np.ndarray | None:
        """(V, 3) linear colours behind the coordinates, white where there are none."""
        has = counts >= 6
        if not has.any():
            return None
        colours = rows(values, counts, 6, np.nan)[:, 3:]
        account.hold("colours of vertices", int(has.sum()))
        account.use("colours of vertices", int(has.sum()))
        most = np.nanmax(colours, initial=1.0)
        return srgb_decode(np.nan_to_num(colours / (255.0 if most > 1 else 1.0), nan=1.0))

    @staticmethod
    def _absolute(
        corners: np.ndarray, counts: np.ndarray, statements: Statements,
        tables: tuple[np.ndarray, ...], account: Account,
    ) -> None:  # fmt: skip
        """Count indices (C, 3) from 0, in place; -1 is none.  Those below 0 count back from their
        line (appendix B1, "Referencing groups of vertices")."""
        for k, (word, table) in enumerate(zip(("v", "vt", "vn"), tables, strict=True)):
            index = corners[:, k]
            back = index < 0
            if back.any():
                so_far = np.searchsorted(statements.lines(word), statements.lines("f"))
                index[back] += np.repeat(so_far, counts)[back] + 1
                index[back & (index <= 0)] = len(table) + 1
            index -= 1
            wrong = (index >= len(table)) | (index < 0) & (k == 0)
            if wrong.any() and k == 0:
                raise ValueError(f"face names vertex {index[wrong][0] + 1} of {len(table)}")
            if wrong.any():
                index[wrong] = -1
                words = f"{PER_CORNER[k]} that the file lacks and its faces name"
                account.lose(PER_CORNER[k], LEFT_OUT, words, 0)

    def part(self, chosen: np.ndarray | slice) -> SurfaceMesh:
        """Some triangles, without their surface."""
        point, uv, normal = np.moveaxis(self._corners[self._triangles[chosen]], -1, 0)
        uvs = self.uvs[uv] * (uv >= 0)[..., None] if (uv >= 0).any() else None
        normals = self.normals[normal] if normal.size and (normal >= 0).all() else None
        colours = None if self.colours is None else self.colours[point]
        return SurfaceMesh(self.points[point], normals=normals, uvs=uvs, colours=colours)


def _corners(text: bytes) -> tuple[np.ndarray, np.ndarray]:
    """Each corner's vertex, texture coordinate and normal, (C, 3) int64, 0 for none; and the number
    of corners per face."""
    if b"/" not in text:
        values, counts = numbers(text, np.int64)
        return np.stack([values, *np.zeros((2, len(values)), np.int64)], -1), counts
    for old, new in ((b"//", b"/0/"), (b"/ ", b"/0 "), (b"/\n", b"/0\n")):
        text = text.replace(old, new) if old in text else text
    starts, counts = words_of(text)
    values, _ = numbers(text.replace(b"/", b" "), np.int64)
    slashes = np.add.reduceat(np.frombuffer(text, np.uint8) == ord("/"), starts, dtype=np.int8)
    if slashes.max(initial=0) > 2 or len(values) != (slashes + 1).sum(dtype=np.int64):
        raise ValueError("a face has a corner that is not vertex/texture/normal")
    return rows(values, slashes + 1, 3, 0).astype(np.int64), counts
