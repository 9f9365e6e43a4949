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
from lfcore.scene.notes import NOT_USED, Notebook
from lfcore.scene.surface_mesh import Surface, SurfaceMesh

HEAD = re.compile(rb"\s*(ST)?(C)?(N)?(4)?(n)?OFF(\s+BINARY)?(?=[\s#\d])")
MOST_NUMBERS = 16
"""The most numbers of a vertex."""


def read_off(data: bytes, path: Path, notebook: Notebook, account: Account) -> list[SurfaceMesh]:
    """The part of an OFF file; normals are those of the file."""
    text = plain(data)
    head = HEAD.match(text)
    has_uvs, _, has_normals, *unread = head.groups() if head else (None,) * 6
    if any(unread):
        raise ValueError("points of four or more dimensions, and binary OFF, are not read")
    values, counts = numbers(text[head.end() :] if head else text)
    counts = counts[counts > 0]
    if not len(counts) or not 2 <= counts[0] <= 3:
        raise ValueError("it does not say how many vertices and faces it has")
    vertices, faces = whole(values[:2]).tolist()
    first, end = 1 + vertices, 1 + vertices + faces
    if len(counts) < end:
        raise ValueError(f"it is cut short: {len(counts) - 1} lines of {vertices} + {faces}")
    if len(counts) > end:
        notebook.add(NOT_USED, path, f"{len(counts) - end} lines at its end")
    starts = np.append(0, np.cumsum(counts))
    widths = counts[1:first]
    if vertices and not 3 <= widths.min() <= widths.max() <= MOST_NUMBERS:
        raise ValueError(f"a vertex has {widths.min()} to {widths.max()} numbers")
    columns = values[starts[1] : starts[first]]
    table = rows(columns, widths, int(widths.max(initial=3)), 0.0)
    points, end_of_colours = table[:, :3], table.shape[1] - 2 * bool(has_uvs)
    attributes = {"normals": table[:, 3:6] if has_normals else None}
    attributes["uvs"] = table[:, -2:] if has_uvs else None
    colours = table[:, 3 + 3 * bool(has_normals) : end_of_colours]
    coloured = colours.shape[1] in (3, 4)
    account.hold("vertices", vertices)
    account.use("vertices", vertices)
    if colours.shape[1]:
        account.hold("colours of vertices", vertices)
        account.use("colours of vertices", vertices if coloured else 0)
    if colours.shape[1] == 4 and np.ptp(colours[:, 3]) > 0:
        notebook.add(NOT_USED, path, "alpha of vertices")
    index, sides = _faces(values, starts[first:end], counts[first:end], vertices)
    picked, polygon = triangulate(points, index, sides, account)
    corners = index[picked]
    attributes["colours"] = display_colours(colours[:, :3]) if coloured else None
    attributes = {
        name: column[corners] for name, column in attributes.items() if column is not None
    }
    face_colours = _of_faces(
        values, starts[first:end] + 1 + sides, counts[first:end] - 1 - sides, account
    )
    if face_colours is not None and not coloured:
        attributes["colours"] = np.repeat(face_colours[polygon][:, None], 3, 1)
    surface = Surface(path.stem, diffuse=(1.0 if "colours" in attributes else 0.8,) * 3)
    return [SurfaceMesh(points[corners], surface, **attributes)]


def _faces(
    values: np.ndarray, starts: np.ndarray, counts: np.ndarray, vertices: int
) -> tuple[np.ndarray, np.ndarray]:
    """The vertices at the corners of all faces, and the corners of each."""
    sides = whole(values[starts])
    if ((sides < 1) | (sides > counts - 1)).any():
        raise ValueError("a face has not as many vertices as it says")
    within = np.arange(sides.sum()) - np.repeat(np.cumsum(sides) - sides, sides)
    index = whole(values[np.repeat(starts, sides) + 1 + within])
    if index.max(initial=-1) >= vertices:
        raise ValueError(f"a face names vertex {index.max()} of {vertices}")
    return index, sides


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
