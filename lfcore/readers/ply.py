"""PLY files as meshes: polygons and strips with normals, texture coordinates and colours.

Names of properties are those that Blender, MeshLab, CloudCompare and pbrt's exporters write.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from lfcore.readers.account import Account
from lfcore.readers.colours import display_colours
from lfcore.readers.ply_elements import Lists, Ply
from lfcore.readers.polygons import strip_faces, triangulate
from lfcore.readers.side_files import beside, read_texture
from lfcore.reading import Where
from lfcore.scene.notes import LEFT_OUT, NOT_USED, Notebook
from lfcore.scene.surface_mesh import Surface, SurfaceMesh

NORMALS = (("nx", "ny", "nz"), ("normal_x", "normal_y", "normal_z"))
UVS = (
    ("u", "v"), ("s", "t"), ("texture_u", "texture_v"), ("texture_s", "texture_t"), ("tx", "ty"),
)  # fmt: skip
COLOURS = (
    ("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue"),
)  # fmt: skip
ALPHA = ("alpha", "a", "diffuse_alpha")
INDICES = ("vertex_indices",), ("vertex_index",)


def read_ply(data: bytes, path: Path, notebook: Notebook, account: Account) -> list[SurfaceMesh]:
    """The parts of a PLY file, one per texture; normals are those of the file."""
    ply = Ply(data)
    part, numbers = part_of(ply, account)
    if ply.rest:
        unit = "numbers" if ply.is_text else "bytes"
        notebook.add(NOT_USED, path, f"{ply.rest} {unit} that belong to no element")
    names = [line[11:].strip() for line in ply.comments if line.startswith("TextureFile")]
    parts = []
    for number in np.unique(numbers).tolist() if len(names) > 1 else [0]:
        texture = _texture(names[number], path, account) if 0 <= number < len(names) else None
        white = texture is not None or part.colours is not None
        surface = Surface(path.stem, (1.0 if white else 0.8,) * 3, texture=texture)
        with_texture = part.picked(numbers == number) if len(names) > 1 else part
        parts.append(replace(with_texture, surface=surface))
    return parts


def _texture(name: str, path: Path, account: Account) -> np.ndarray | None:
    """(H, W, 3) uint8 of a comment's TextureFile; None and a note if it is not there."""
    account.hold("textures")
    file = beside(name, path)
    if file is None:
        account.lose("textures", LEFT_OUT, f"texture {name!r}, not found")
        return None
    account.use("textures")
    return read_texture(file, Where(path))


def part_of(ply: Ply, account: Account) -> tuple[SurfaceMesh, np.ndarray]:
    """All triangles, without their surface, and (T,) the number of each one's texture.

    Raises ValueError for elements that make no sense.
    """
    return _Mesh(ply, account).part()


class _Mesh:
    """The triangles of a PLY file, and the properties that make them."""

    def __init__(self, ply: Ply, account: Account):
        self._ply, self._account = ply, account
        self._used: set[tuple[str, str]] = set()

    def part(self) -> tuple[SurfaceMesh, np.ndarray]:
        points = self._columns("vertex", (("x", "y", "z"),))
        if points is None:
            raise ValueError("its vertices have no x, y and z")
        points = points.astype(np.float64)
        faces = self._lists("face", INDICES) or Lists(np.zeros(0), np.zeros(0, np.int64))
        index = _checked(faces.values, len(points), 0)
        picked, polygon = triangulate(points, index, faces.counts, self._account)
        corners = np.concatenate([index[picked], self._strips(len(points))])
        attributes = {}
        for name, groups in (("normals", NORMALS), ("uvs", UVS)):
            if (values := self._columns("vertex", groups)) is not None:
                attributes[name] = np.nan_to_num(values.astype(np.float64))[corners]
        if (colours := self._colours("vertex")) is not None:
            attributes["colours"] = colours[corners]
        textures = np.zeros(len(corners), np.int64)
        if len(polygon) == len(corners):  # no strips
            numbers = self._columns("face", (("texnumber",),))
            textures = textures if numbers is None else numbers[polygon, 0].astype(np.int64)
            if colours is None and (face_colours := self._colours("face")) is not None:
                attributes["colours"] = np.repeat(face_colours[polygon][:, None], 3, 1)
            wedges = self._lists("face", (("texcoord",), ("texcoords",)))
            if wedges is not None and (wedges.counts == 2 * faces.counts).all():
                attributes["uvs"] = wedges.values.reshape(-1, 2).astype(np.float64)[picked]
            elif wedges is not None:
                self._used -= {("face", "texcoord"), ("face", "texcoords")}
        self._close()
        return SurfaceMesh(points[corners], **attributes), textures

    def _columns(self, element: str, names: Sequence[tuple[str, ...]]) -> np.ndarray | None:
        """(count, width) of the first group of numbers that the element has."""
        properties = self._ply.elements.get(element, {})
        for group in names:
            columns = [
                values for name in group if isinstance(values := properties.get(name), np.ndarray)
            ]
            if len(columns) == len(group):
                self._used |= {(element, name) for name in group}
                return np.stack(columns, -1)
        return None

    def _lists(self, element: str, names: Sequence[tuple[str]]) -> Lists | None:
        properties = self._ply.elements.get(element, {})
        for (name,) in names:
            if isinstance(values := properties.get(name), Lists):
                self._used.add((element, name))
                return values
        return None

    def _colours(self, element: str) -> np.ndarray | None:
        """(count, 3) linear colours of an element."""
        for name in ALPHA:  # an equal alpha everywhere needs no note
            alpha = self._ply.elements.get(element, {}).get(name)
            if isinstance(alpha, np.ndarray) and np.ptp(alpha) == 0:
                self._used.add((element, name))
        values = self._columns(element, COLOURS)
        return None if values is None else display_colours(values)

    def _strips(self, vertices: int) -> np.ndarray:
        """(T, 3) vertices of the triangles of all strips."""
        strips, faces = self._lists("tristrips", INDICES), [np.zeros((0, 3), np.int64)]
        if strips is not None:
            index = _checked(strips.values, vertices, -1)
            faces += map(strip_faces, np.split(index, np.cumsum(strips.counts)[:-1]))
        return np.concatenate(faces)

    def _close(self) -> None:
        """Count elements, and the properties of used elements."""
        for element, properties in self._ply.elements.items():
            count = self._ply.counts[element]
            names_used = {name for owner, name in self._used if owner == element}
            if element != "face":  # triangulation counts them
                things = "vertices" if element == "vertex" else f"elements '{element}'"
                self._account.hold(things, count)
                self._account.use(things, count if names_used else 0)
            for name in properties if names_used else ():
                self._account.hold(f"values of {element}.{name}", count)
                self._account.use(f"values of {element}.{name}", count if name in names_used else 0)


def _checked(index: np.ndarray, count: int, least: int) -> np.ndarray:
    """Indices as int64; ValueError for one that no vertex has."""
    index = index.astype(np.int64)
    wrong = index[(index < least) | (index >= count)]
    if len(wrong):
        raise ValueError(f"a face names vertex {wrong[0]} of {count}")
    return index
