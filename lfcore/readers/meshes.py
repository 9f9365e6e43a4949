"""Mesh files: the reader of each format."""

import os
from collections.abc import Callable
from pathlib import Path

from lfcore.readers import collada, threemf
from lfcore.readers.account import Account
from lfcore.readers.content import Content
from lfcore.readers.gltf.document import SUFFIXES as GLTF
from lfcore.readers.gltf.meshes import read_gltf
from lfcore.readers.obj import read_obj
from lfcore.readers.off import read_off
from lfcore.readers.ply import read_ply
from lfcore.readers.stl import read_stl
from lfcore.reading import LARGEST_MESH, Where, read_bytes
from lfcore.scene.notes import Notebook
from lfcore.scene.surface_mesh import SurfaceMesh, shaded

READERS: dict[str, Callable[[bytes, Path, Notebook, Account], list[SurfaceMesh]]] = {
    ".obj": read_obj, ".ply": read_ply, ".stl": read_stl, ".off": read_off,
    **dict.fromkeys(collada.SUFFIXES, collada.read_collada),
    **dict.fromkeys(threemf.SUFFIXES, threemf.read_3mf),
}  # fmt: skip
"""They raise ValueError for what makes no sense."""
WITH_AXIS = (*GLTF, *collada.SUFFIXES, *threemf.SUFFIXES)
"""The formats that say where up is."""


def read_mesh(
    path: str | Path,
    *,
    shading: str = "auto",
    crease_deg: float = 40.0,
    animation: str | None = None,
    notebook: Notebook | None = None,
) -> Content:
    """The content of a mesh file, in metres, y up; in its coordinates if it has neither unit nor
    axis.

    ``shading`` is ``auto`` (the file's normals; without them glTF is flat, and others are smooth
    except at edges beyond ``crease_deg``), ``smooth`` or ``flat``.  ``animation`` is the name of
    the one to play, by default the first.  Without its MTL an OBJ has the default material, which
    is noted.
    """
    path = Path(path)
    notebook = Notebook() if notebook is None else notebook
    if not os.path.isfile(path):
        raise Where(path).error("mesh file not found", "Check the path")
    if path.suffix.lower() in GLTF:
        return read_gltf(
            path, notebook, shading=shading, crease_deg=crease_deg, animation=animation
        )
    if animation is not None:
        remedy = "Leave it out, or export glTF"
        raise Where(path, "animation").error("only glTF's animations are read", remedy)
    if (reader := READERS.get(path.suffix.lower())) is None:
        remedy = "Convert it to GLB, e.g. with Blender"
        raise Where(path).error(f"no reader for mesh files named *{path.suffix}", remedy)
    account, data = Account(notebook, path), read_bytes(path, LARGEST_MESH, "mesh file")
    try:
        parts = reader(data, path, notebook, account)
    except ValueError as error:
        remedy = "Export it again, or open it in a mesh viewer to see what is damaged"
        raise Where(path).error(f"mesh cannot be read: {error}", remedy) from None
    if not any(part.count for part in parts):
        remedy = "Export triangles, not only points, lines or curves"
        raise Where(path).error("mesh holds no triangles", remedy)
    account.close()
    return Content([shaded(part, shading, crease_deg) for part in parts])
