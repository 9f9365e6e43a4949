"""Mesh files: glTF by a reader of its own, and all others through trimesh."""

import io
import os
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.errors import LfcoreError, SceneError
from lfcore.pictures import codes_of, open_image, read_picture
from lfcore.readers.content import Content
from lfcore.readers.faces import strip_faces
from lfcore.readers.gltf.document import SUFFIXES
from lfcore.readers.gltf.meshes import read_gltf
from lfcore.reading import LARGEST_MESH, LARGEST_TEXT, Where, read_bytes
from lfcore.scene.notes import LEFT_OUT, Notebook
from lfcore.scene.surface_mesh import Surface, SurfaceMesh
from lfcore.scene.trimesh_parts import clipped, parts_of, picture

STRIP_NAMES = ("vertex_indices", "vertex_index")
NOT_MESHES = {"stl_ascii", "xyz"}
"""Mesh formats by trimesh's list only: the first is no suffix of files, the second holds points."""
POSTSCRIPT = b"%!PS", b"\xc5\xd0\xd3\xc6"
IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".tga", ".bmp", ".webp", ".tif", ".tiff", ".gif")


def _error(path: Path, problem: str, remedy: str = "Export the mesh again") -> SceneError:
    return Where(path).error(problem, remedy)


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
    if path.suffix.lower() in SUFFIXES and os.path.isfile(path):
        return read_gltf(path, notebook, shading=shading, crease_deg=crease_deg)
    scene = _load(path, notebook)
    parts = parts_of(scene, path, shading=shading, crease_deg=crease_deg, of_simple=_of_mtl)
    return Content(parts)


def _load(path: Path, notebook: Notebook) -> Any:
    import trimesh
    from trimesh.resolvers import FilePathResolver

    class Resolver(FilePathResolver):
        """Finds side files; trimesh passes over what is missing or damaged, so remember it."""

        def get(self, name: str) -> Any:
            if not os.path.isfile(path.parent / name):
                name = name.replace("\\", "/")  # written on Windows
            is_picture = Path(name.strip()).suffix.lower() in IMAGE_SUFFIXES
            try:
                data = read_bytes(path.parent / name.strip(), LARGEST_TEXT)
            except SceneError:
                if kind == "obj" and not is_picture:
                    what = f"material library {name.strip()!r}, not found"
                    notebook.add(LEFT_OUT, path, f"{what}; the default material is used")
                else:
                    lacks(f"{'texture' if is_picture else 'file'} {name!r} not found")
                raise
            is_picture |= data[:4] in POSTSCRIPT
            if is_picture and (problem := _problem(data)):
                lacks(f"texture {name!r} {problem}")
                raise ValueError(problem)  # trimesh would give Pillow any format
            return data

    def lacks(problem: str) -> None:
        remedy = f"Put a sound file within the mesh or in {path.parent}, or edit the mesh"
        trouble.append(_error(path, problem, remedy))

    if not os.path.isfile(path):
        raise _error(path, "mesh file not found", "Check the path")
    kind = path.suffix[1:].lower()
    if kind not in trimesh.available_formats():
        known = ", ".join(sorted(trimesh.exchange.load.mesh_formats() - NOT_MESHES))
        problem = f"no reader for mesh files named *{path.suffix}"
        raise _error(path, problem, f"Export the mesh as one of {known}")
    trouble: list[SceneError] = []
    resolver = Resolver(str(path), allow_anywhere=True)
    try:
        with io.BytesIO(read_bytes(path, LARGEST_MESH, "mesh file")) as stream:
            scene = trimesh.load_scene(stream, file_type=kind, resolver=resolver, process=False)
        for name, mesh in scene.geometry.items():
            scene.geometry[name] = with_strips(mesh)
    except SceneError:  # of a file beside it, which it names
        raise
    except Exception as error:  # trimesh's readers raise whatever they stumble over
        if trouble:
            raise trouble[0] from None
        reason = " ".join(str(error).split()) or type(error).__name__
        remedy = "Export it again, or open it in a mesh viewer to see what is damaged"
        raise _error(path, f"mesh cannot be read: {reason[:200]}", remedy) from error
    if trouble:
        raise trouble[0]
    return scene


def _problem(data: bytes) -> str:
    """What is wrong with a picture, if anything."""
    try:
        image = open_image(io.BytesIO(data))
        image.load()
    except Exception:  # Pillow raises many kinds on damaged images
        return "cannot be decoded"
    return ""


def _of_mtl(material: Any, path: Path) -> Surface:
    """OBJ's MTL: Kd, Ks, Ns and map_Kd; Kd and Ks are linear, and Ks needs an Ns to count."""
    given = {key.lower(): value for key, value in (material.kwargs or {}).items()}
    texture = picture(material.image, path)

    def number(key: str, otherwise: float) -> np.ndarray:
        """(3,) of what stands behind a key: a single number counts for all three."""
        value = given.get(key, otherwise)
        try:
            numbers = np.ravel(np.asarray(value, np.float64))
        except (ValueError, TypeError):
            numbers = np.zeros(0)
        if len(numbers) not in (1, 3) or not np.isfinite(numbers).all():
            problem = f"{value!r} is not one finite number or three"
            where = Where(path, f"material {material.name}: {key.title()}")
            raise where.error(problem, "Mend the material file")
        return np.broadcast_to(numbers, 3)

    diffuse = number("kd", 0.8)
    if texture is not None and not diffuse.any():
        diffuse = np.ones(3)  # exporters write Kd 0 0 0 beside a texture and mean the texture
    shininess = float(number("ns", 0.0)[0])
    specular = number("ks", 0.0) if shininess >= 1 else np.zeros(3)
    colours = clipped(diffuse), clipped(specular), clipped(number("ke", 0.0))
    exponent = float(np.clip(shininess, 1, 1000))
    return Surface(material.name or path.stem, *colours[:2], exponent, colours[2], texture)


def read_texture(path: Path, where: Where) -> np.ndarray:
    """An image file as (H, W, 3) uint8 sRGB; :class:`SceneError` if missing or damaged."""
    if not os.path.isfile(path):
        remedy = "Give a path relative to the scene file"
        raise where.error(f"texture {str(path)!r} not found", remedy)
    try:
        return codes_of(read_picture(path))
    except LfcoreError as error:
        problem = f"texture {str(path)!r} cannot be decoded: {error.problem}"
        raise where.error(problem, "Use a PNG or JPEG") from None


def with_strips(mesh: Any) -> Any:
    """A trimesh point cloud of a PLY file with ``tristrips`` as a mesh; anything else as it is.

    Raises ValueError for indices that no vertex has.
    """
    import trimesh

    raw = getattr(mesh, "metadata", {}).get("_ply_raw", {})
    if isinstance(mesh, trimesh.Trimesh) or "tristrips" not in raw or "vertex" not in raw:
        return mesh
    points = np.asarray(mesh.vertices, np.float64)
    faces = np.concatenate([np.zeros((0, 3), np.int64), *map(strip_faces, _strips(raw))])
    if len(faces) and faces.max() >= len(points):
        raise ValueError(f"a strip names vertex {faces.max()} of {len(points)}")
    columns = raw["vertex"].get("data")
    colours = getattr(mesh, "colors", None)
    return trimesh.Trimesh(
        points,
        faces,
        vertex_normals=vertex_columns(columns, len(points), ("nx", "ny", "nz")),
        vertex_colors=colours if colours is not None and len(colours) == len(points) else None,
        metadata=mesh.metadata,
        process=False,
    )


def _strips(raw: dict) -> list[np.ndarray]:
    """The strips of trimesh's raw data: a dictionary for text, a structured array for binary."""
    data = raw["tristrips"].get("data")
    known = data.keys() if isinstance(data, dict) else getattr(data, "dtype", np.dtype("f4")).names
    name = next((name for name in STRIP_NAMES if name in (known or ())), None)
    if name is None:
        return []
    rows = data[name] if isinstance(data, dict) else data[name]["f1"]
    return list(rows)


def vertex_columns(raw: Any, count: int, names: tuple[str, ...]) -> np.ndarray | None:
    """Vertex properties of a PLY file as (count, len(names)) float64; None when it lacks them."""
    # The reader gives a structured array for binary files and a dictionary for text.
    known = raw.keys() if isinstance(raw, dict) else getattr(raw, "dtype", np.dtype("f4")).names
    if not set(names) <= set(known or ()) or any(len(raw[name]) != count for name in names):
        return None
    return np.stack([np.asarray(raw[name], np.float64).reshape(count) for name in names], -1)
