"""OFF files: polygons with colours of vertices or faces.

Source: Geomview's manual, "OFF Files": the letters before OFF say what vertices have.
"""

import re
from pathlib import Path

import numpy as np

from lfcore.readers.account import Account
from lfcore.readers.colours import display_colours
from lfcore.readers.polygons import triangulate
from lfcore.readers.text import numbers, plain, rows, whole
from lfcore.reading import LARGEST_MESH, Where, read_bytes
from lfcore.scene.notes import NOT_USED, Notebook
from lfcore.scene.surface_mesh import Surface, SurfaceMesh

HEAD = re.compile(rb"\s*(ST)?(C)?(N)?(4)?(n)?OFF(\s+BINARY)?(?=[\s#\d])")


def read_off(path: Path, notebook: Notebook) -> list[SurfaceMesh]:
    """The part of an OFF file; normals are those of the file."""
    account = Account(notebook, path)
    try:
        part = _part(read_bytes(path, LARGEST_MESH, "mesh file"), path, notebook, account)
    except ValueError as error:
        problem = f"mesh cannot be read: {error}"
        raise Where(path).error(problem, "Export it again") from None
    if not part.count:
        raise Where(path).error("mesh holds no triangles", "Export it again, with faces")
    account.close()
    return [part]


def _part(data: bytes, path: Path, notebook: Notebook, account: Account) -> SurfaceMesh:
    text = plain(data)
    head = HEAD.match(text)
    has_uvs, _, has_normals, four, many, binary = head.groups() if head else (None,) * 6
    if four or many or binary:
        raise ValueError("points of four or more dimensions, and binary OFF, are not read")
    values, counts = numbers(text[head.end() :] if head else text)
    starts, counts = (np.cumsum(counts) - counts)[counts > 0], counts[counts > 0]
    if not len(counts) or not 2 <= counts[0] <= 3:
        raise ValueError("it does not say how many vertices and faces it has")
    vertices, faces = whole(values[:2]).tolist()
    if len(counts) - 1 < vertices + faces:
        raise ValueError(f"it is cut short: {len(counts) - 1} lines of {vertices} + {faces}")
    if len(counts) - 1 > vertices + faces:
        notebook.add(NOT_USED, path, f"{len(counts) - 1 - vertices - faces} lines at its end")
    of_vertices = slice(1, 1 + vertices)
    stop = int(starts[vertices] + counts[vertices]) if vertices else int(counts[0])
    columns, widths = values[counts[0] : stop], counts[of_vertices]
    if vertices and widths.min() < 3:
        raise ValueError(f"a vertex has {widths.min()} coordinates")
    table = rows(columns, widths, int(widths.max(initial=3)), 0.0)
    points, at = table[:, :3], 3 + 3 * bool(has_normals)
    normals = table[:, 3:6] if has_normals else None
    uvs = table[:, -2:] if has_uvs else None
    extra = table[:, at : table.shape[1] - 2 * bool(has_uvs)]
    account.hold("vertices", vertices)
    account.use("vertices", vertices)
    coloured = extra.shape[1] in (3, 4)
    if extra.shape[1] == 4 and np.ptp(extra[:, 3]) > 0:
        notebook.add(NOT_USED, path, "alpha of vertices")
    if extra.shape[1]:
        account.hold("colours of vertices", vertices)
        account.use("colours of vertices", vertices if coloured else 0)
    begins = starts[1 + vertices : 1 + vertices + faces]
    width = counts[1 + vertices : 1 + vertices + faces]
    sides = whole(values[begins])
    if ((sides < 1) | (sides > width - 1)).any():
        raise ValueError("a face has not as many vertices as it says")
    within = np.arange(sides.sum()) - np.repeat(np.cumsum(sides) - sides, sides)
    index = whole(values[np.repeat(begins, sides) + 1 + within])
    if index.max(initial=-1) >= vertices:
        raise ValueError(f"a face names vertex {index.max()} of {vertices}")
    picked, polygon = triangulate(points, index, sides, account)
    corners = index[picked]
    colours = display_colours(extra[:, :3])[corners] if coloured else None
    if colours is None:
        colours = _of_faces(values, begins + 1 + sides, width - 1 - sides, account)
        colours = None if colours is None else np.repeat(colours[polygon][:, None], 3, 1)
    surface = Surface(path.stem, diffuse=(0.8 if colours is None else 1.0,) * 3)
    normals, uvs = (None if each is None else each[corners] for each in (normals, uvs))
    return SurfaceMesh(points[corners], surface, normals, uvs, colours)


def _of_faces(
    values: np.ndarray, starts: np.ndarray, counts: np.ndarray, account: Account
) -> np.ndarray | None:
    """(F, 3) linear colours behind the indices of faces, white for those that have none."""
    has = counts >= 3
    if counts.any():
        account.hold("colours of faces", int((counts > 0).sum()))
        account.use("colours of faces", int(has.sum()))
    if not has.any():
        return None
    colours = np.ones((len(counts), 3))
    colours[has] = display_colours(values[starts[has, None] + np.arange(3)])
    return colours
