"""STL files, binary and text, with the colours of SolidView and of Materialise Magics.

Source: 3D Systems, "StereoLithography Interface Specification" (1988); for colours the notes of the
two programs, 15 bits per triangle in the two bytes that the format leaves free.
"""

from pathlib import Path

import numpy as np

from lfcore.colour import srgb_decode
from lfcore.readers.account import Account
from lfcore.readers.text import Statements, rows
from lfcore.scene.notes import NOT_USED, Notebook
from lfcore.scene.surface_mesh import Surface, SurfaceMesh

HEAD = 84
"""Bytes before the first triangle: a header of 80, and the number of triangles."""
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("colour", "<u2")])


def read_stl(data: bytes, path: Path, notebook: Notebook, account: Account) -> list[SurfaceMesh]:
    """The part of an STL file; normals are those of the triangles' winding."""
    count = int.from_bytes(data[80:HEAD], "little") if len(data) >= HEAD else 0
    end = HEAD + count * TRIANGLE.itemsize
    colours = None
    head = data[:4096].lower()
    is_text = b"vertex" in head or (head.lstrip()[:5] == b"solid" and b"\0" not in head)
    if is_text and end != len(data):
        corners = _text(data, account)
    elif end <= len(data) and len(data) >= HEAD:
        facets = np.frombuffer(data, TRIANGLE, count, HEAD)
        corners = facets["corners"].astype(np.float64)
        colours = _colours(data[:80], facets["colour"], account)
        if data[end:].strip(b"\0"):
            notebook.add(NOT_USED, path, f"{len(data) - end} bytes at its end")
    else:
        raise ValueError(f"it has {len(data)} bytes, of {end} for {count} triangles")
    account.hold("triangles", len(corners))
    account.use("triangles", len(corners))
    surface = Surface(path.stem, diffuse=(0.8 if colours is None else 1.0,) * 3)
    return [SurfaceMesh(corners, surface, colours=colours)]


def _text(data: bytes, account: Account) -> np.ndarray:
    """(T, 3, 3) corners of a text."""
    if b"VERTEX" in data[:4096]:
        data = data.lower()
    found = Statements(
        data, ("vertex", "facet", "outer", "endloop", "endfacet", "solid", "endsolid")
    )
    values, counts = found.numbers("vertex")
    if len(counts) and counts.min() < 3:
        raise ValueError(f"a vertex has {counts.min()} coordinates")
    if len(counts) != 3 * len(found.lines("endloop")):
        raise ValueError("a facet has not three corners")
    for _, word, _ in found.others():
        account.hold(f"statements {word[:16]!r}")
    return rows(values, counts, 3, 0.0).reshape(-1, 3, 3)


def _colours(head: bytes, bits: np.ndarray, account: Account) -> np.ndarray | None:
    """(T, 3, 3) linear colours; None where the file has none."""
    at = head.find(b"COLOR=")
    if not bits.any() and at < 0:
        return None
    five = np.stack([bits >> shift & 31 for shift in (10, 5, 0)], -1) / 31.0
    own = bits >> 15 == 1
    whole = np.ones(3)
    if at >= 0:  # Magics: red is lowest, and the highest bit means the whole part's colour
        five, own = five[:, ::-1], own == 0
        whole = np.frombuffer(head[at + 6 : at + 9].ljust(3, b"\xff"), np.uint8) / 255
    elif not own.any():
        account.hold("values of the two spare bytes", int((bits > 0).sum()))
        return None
    account.hold("colours of triangles", len(bits))
    account.use("colours of triangles", len(bits))
    return np.repeat(srgb_decode(np.where(own[:, None], five, whole))[:, None], 3, 1)
