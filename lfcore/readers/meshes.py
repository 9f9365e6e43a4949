"""Mesh files: the common formats by readers of their own, all others through trimesh."""

import io
import os
from pathlib import Path
from typing import Any

from lfcore.errors import SceneError
from lfcore.readers.content import Content
from lfcore.readers.gltf.document import SUFFIXES
from lfcore.readers.gltf.meshes import read_gltf
from lfcore.readers.obj import read_obj
from lfcore.readers.off import read_off
from lfcore.readers.ply import read_ply
from lfcore.readers.stl import read_stl
from lfcore.reading import LARGEST_MESH, LARGEST_TEXT, Where, read_bytes
from lfcore.scene.notes import Notebook
from lfcore.scene.surface_mesh import SurfaceMesh, shaded
from lfcore.scene.trimesh_parts import parts_of

READERS = {".obj": read_obj, ".ply": read_ply, ".stl": read_stl, ".off": read_off}
PACKAGES = {".dae": "pycollada", ".zae": "pycollada", ".3mf": "lxml", ".3dxml": "lxml"}
"""The packages with which trimesh reads further formats."""
NOT_MESHES = {"stl_ascii", "xyz"}
"""Mesh formats by trimesh's list only: the first is no suffix of files, the second holds points."""


def load_mesh(
    path: str | Path,
    *,
    shading: str = "auto",
    crease_deg: float = 40.0,
    notebook: Notebook | None = None,
) -> list[SurfaceMesh]:
    """The parts of a mesh file, as :func:`read_mesh`."""
    return read_mesh(path, shading=shading, crease_deg=crease_deg, notebook=notebook).parts


def read_mesh(
    path: str | Path,
    *,
    shading: str = "auto",
    crease_deg: float = 40.0,
    notebook: Notebook | None = None,
) -> Content:
    """What a mesh file holds, in its own coordinates (taken as metres, y up).

    ``shading`` is ``auto`` (the file's normals; without any glTF is flat, and others are smoothed
    but for edges beyond ``crease_deg``), ``smooth`` or ``flat``. Without its MTL an OBJ has the
    default material, which is noted.
    """
    path = Path(path)
    notebook = Notebook() if notebook is None else notebook
    if not os.path.isfile(path):
        raise Where(path).error("mesh file not found", "Check the path")
    if path.suffix.lower() in SUFFIXES:
        return read_gltf(path, notebook, shading=shading, crease_deg=crease_deg)
    if (read := READERS.get(path.suffix.lower())) is not None:
        return Content([shaded(part, shading, crease_deg) for part in read(path, notebook)])
    return Content(parts_of(_load(path), path, shading=shading, crease_deg=crease_deg))


def _load(path: Path) -> Any:
    import trimesh  # the heaviest import of the package
    from trimesh.resolvers import FilePathResolver

    class Resolver(FilePathResolver):
        """Reads side files within bounds of size."""

        def get(self, name: str) -> bytes:
            return read_bytes(path.parent / name.strip(), LARGEST_TEXT)

    kind = path.suffix[1:].lower()
    if kind not in trimesh.available_formats():
        known = ", ".join(sorted(trimesh.exchange.load.mesh_formats() - NOT_MESHES))
        package = PACKAGES.get(path.suffix.lower())
        remedy = f"Export the mesh as one of {known}"
        if package:
            remedy = f"Install the package {package}, or export the mesh as GLB"
        raise Where(path).error(f"no reader for mesh files named *{path.suffix}", remedy)
    try:
        resolver = Resolver(str(path), allow_anywhere=True)
        with io.BytesIO(read_bytes(path, LARGEST_MESH, "mesh file")) as stream:
            return trimesh.load_scene(stream, file_type=kind, resolver=resolver, process=False)
    except SceneError:
        raise
    except Exception as error:  # trimesh's readers raise whatever they stumble over
        reason = " ".join(str(error).split()) or type(error).__name__
        remedy = "Export it again, or open it in a mesh viewer to see what is damaged"
        raise Where(path).error(f"mesh cannot be read: {reason[:200]}", remedy) from error
