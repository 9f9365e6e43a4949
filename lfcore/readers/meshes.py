"""Mesh files, through trimesh: geometry, normals, textures, vertex colours, materials.

Whatever trimesh loads is accepted; for materials see :mod:`lfcore.readers.gltf_materials`.
"""

import io
import os
import urllib.parse
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.colour import srgb_decode
from lfcore.errors import LfcoreError, SceneError
from lfcore.pictures import codes_of, open_image, read_picture
from lfcore.readers.gltf import DRACO, GLOSSY, SUFFIXES, Document, has
from lfcore.readers.gltf_materials import GltfSurfaces, clipped, picture, surface_of_pbr
from lfcore.reading import Where
from lfcore.scene.notes import LEFT_OUT, Notebook
from lfcore.scene.surface_mesh import Surface, SurfaceMesh, crease_normals

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
    """The parts of a mesh file, in its own coordinates (taken as metres, y up).

    ``shading`` is ``auto`` (the file's normals, else smoothed but for edges beyond ``crease_deg``),
    ``smooth`` or ``flat``. Without its MTL an OBJ has the default material, which is noted.
    """
    path = Path(path)
    notebook = Notebook() if notebook is None else notebook
    gltf = None
    if path.suffix.lower() in SUFFIXES and os.path.isfile(path):
        gltf = GltfSurfaces(Document(path), notebook)
        gltf.document.note_what_is_left_out(notebook)
    scene = _load(path, gltf.document if gltf else None, notebook)
    return parts_of(scene, path, shading=shading, crease_deg=crease_deg, gltf=gltf)


def parts_of(
    scene: Any,
    path: Path,
    *,
    shading: str = "auto",
    crease_deg: float = 40.0,
    gltf: GltfSurfaces | None = None,
) -> list[SurfaceMesh]:
    """The parts of a ``trimesh.Scene``, as :func:`load_mesh`; ``path`` names it in errors."""
    import trimesh  # the heaviest import of the package, not needed by procedural scenes

    try:
        nodes = [scene.graph[node] for node in scene.graph.nodes_geometry]
        meshes = [(matrix, scene.geometry[name]) for matrix, name in nodes]
    except (LookupError, TypeError, ValueError) as error:  # names that are none, circles of nodes
        raise _error(path, f"its nodes cannot be placed: {error!r}") from error
    parts, empty = [], True
    for matrix, placed in meshes:
        try:
            mesh = with_strips(placed)
        except ValueError as error:
            raise _error(path, str(error)) from None
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
            empty = False
            surface, uvs = _surface(mesh.visual, np.asarray(mesh.faces, np.int64), path, gltf)
            if surface is not None:
                part = _part(mesh, surface, uvs, path, shading, crease_deg)
                parts.append(part.transformed(np.asarray(matrix, np.float64)))
    if empty:
        remedy = "Export triangles, not only points, lines or fans"
        raise _error(path, "mesh holds no triangles", remedy)
    return parts


def _load(path: Path, document: Document | None, notebook: Notebook) -> Any:
    import trimesh
    from trimesh.exchange.gltf import extensions
    from trimesh.resolvers import FilePathResolver

    class Resolver(FilePathResolver):
        """Finds side files; trimesh passes over what is missing or damaged, so remember it."""

        def get(self, name: str) -> Any:
            here = os.path.isfile(path.parent / name)
            if document and not here:  # its names are URIs: spaces and others are escaped
                name = urllib.parse.unquote(name)
            elif not here:
                name = name.replace("\\", "/")  # written on Windows
            is_picture = Path(name.strip()).suffix.lower() in IMAGE_SUFFIXES
            try:
                data = super().get(name)
            except (OSError, ValueError):
                if kind == "obj" and not is_picture:
                    what = f"material library {name.strip()!r}, not found"
                    notebook.add(LEFT_OUT, path, f"{what}; the default material is used")
                else:
                    lacks(f"{'texture' if is_picture else 'file'} {name!r} not found")
                raise
            is_picture |= data[:4] in POSTSCRIPT
            if is_picture and (problem := _problem(data, glossy)):
                lacks(f"texture {name!r} {problem}")
                raise ValueError(problem)  # trimesh would give Pillow any format
            return data

    def lacks(problem: str) -> None:
        remedy = f"Put a sound file within the mesh or in {path.parent}, or edit the mesh"
        trouble.append(_error(path, problem, remedy))

    @extensions.register_handler(DRACO, "primitive_preprocess")
    def unpack(context: Any) -> None:
        """As trimesh, which goes on with zeros for what it cannot unpack, so remember it."""
        try:
            assert document is not None  # of glTF
            document.view(context["data"]["bufferView"])  # it is whole
            placed = {name: context["primitive"]["attributes"][name]
                      for name in context["data"]["attributes"]}  # fmt: skip
            before = [context["accessors"][number] for number in placed.values()]
            extensions.draco_decode(context)
            for (name, number), old in zip(placed.items(), before, strict=True):
                if context["accessors"][number] is old:
                    raise ValueError(f"it has no {name}")
        except ImportError:
            remedy = "Install the package DracoPy, or export the file without compression"
            trouble.append(_error(path, "its meshes are compressed by Draco", remedy))
        except Exception as error:
            trouble.append(_error(path, f"mesh cannot be read: Draco's data: {error!r}"))

    if not os.path.isfile(path):
        raise _error(path, "mesh file not found", "Check the path")
    kind = path.suffix[1:].lower()
    if kind not in trimesh.available_formats():
        known = ", ".join(sorted(trimesh.exchange.load.mesh_formats() - NOT_MESHES))
        problem = f"no reader for mesh files named *{path.suffix}"
        raise _error(path, problem, f"Export the mesh as one of {known}")
    trouble: list[SceneError] = []
    resolver = Resolver(str(path), allow_anywhere=True)
    glossy = document is not None and any(has(m, GLOSSY) for m in document.objects("materials"))
    try:
        for number, data in document.pictures() if document else ():
            if problem := _problem(data, glossy):
                lacks(f"image {number} {problem}")
                raise trouble[0]
        with io.BytesIO(document.readable()) if document else path.open("rb") as stream:
            scene = trimesh.load_scene(stream, file_type=kind, resolver=resolver, process=False)
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


def _problem(data: bytes, glossy: bool) -> str:
    """What is wrong with a picture, if anything; ``glossy``: trimesh converts its material."""
    try:
        image = open_image(io.BytesIO(data))
        image.load()
    except Exception:  # Pillow raises many kinds on damaged images
        return "cannot be decoded"
    if glossy and image.mode == "P":  # trimesh takes the numbers in a palette for colours
        return f"has a palette, which cannot be read with {GLOSSY}: save it as RGB"
    return ""


def _part(
    mesh: Any, surface: Surface, uvs: np.ndarray | None, path: Path, shading: str, crease_deg: float
) -> SurfaceMesh:
    vertices = np.asarray(mesh.vertices, np.float64)
    faces = np.asarray(mesh.faces, np.int64)
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        count = vertices.shape[-1] if vertices.ndim == 2 else "no"
        raise _error(path, f"a vertex has {count} coordinates", "Give each vertex x, y and z")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise _error(path, f"face names vertex {int(faces.max())} of {len(vertices)}")
    triangles = vertices[faces]
    normals = None
    # trimesh computes normals on demand; only those in the cache came with the file.
    given = mesh._cache.cache.get("vertex_normals") if shading == "auto" else None
    if given is not None and np.shape(given) == vertices.shape:
        normals = np.asarray(given, np.float64)[faces]
    elif shading != "flat":
        finite = np.nan_to_num(triangles, nan=0.0, posinf=0.0, neginf=0.0)
        normals = crease_normals(finite, crease_deg)
        if np.ptp(normals, axis=1).max(initial=0.0) < 1e-6:
            normals = None  # no corner is smooth, so that it stays flat shaded
    colours = _colours(mesh.visual, faces, path)
    surface = replace(surface, curved=normals is not None)
    return SurfaceMesh(triangles, surface, normals, uvs, colours)


def _surface(
    visual: Any, faces: np.ndarray, path: Path, gltf: GltfSurfaces | None
) -> tuple[Surface | None, np.ndarray | None]:
    """Surface and texture coordinates (T, 3, 2) of a mesh; no surface: it is wholly cut out."""
    from trimesh.visual.material import PBRMaterial, SimpleMaterial

    material = getattr(visual, "material", None)
    if _is_invented(material, path):
        material = None
    of_gltf = gltf if isinstance(material, PBRMaterial) else None
    made: Surface | None
    if of_gltf:
        made = of_gltf.surface(material, getattr(visual, "vertex_attributes", {}).get("color"))
    elif isinstance(material, PBRMaterial):
        made = surface_of_pbr(material, path)
    elif isinstance(material, SimpleMaterial):
        bare = not material.kwargs and not path.suffix  # made in memory: it has no MTL's keys
        made = surface_of_pbr(material.to_pbr(), path) if bare else _of_mtl(material, path)
    else:
        made = Surface(path.stem)
    if made is not None:
        values = (*made.diffuse, *made.specular, *made.emission, made.shininess)
        if not np.isfinite(values).all():
            problem = f"material {made.name!r} has a number that is not finite"
            raise _error(path, problem, "Mend the material")
    uv = getattr(visual, "uv", None)
    if uv is None or len(uv) == 0:
        return made, None
    try:
        uvs = _texture_coordinates(np.asarray(uv, np.float64), faces, path)
        return made, of_gltf.uvs(material, uvs) if of_gltf else uvs
    except SceneError:
        if made is None or not made.has_textures:
            return made, None  # nothing is read there
        raise


def _texture_coordinates(uv: np.ndarray, faces: np.ndarray, path: Path) -> np.ndarray:
    """(T, 3, 2) of the corners; exporters write NaN for what is not unwrapped, read as 0."""
    uv = np.where(np.isnan(uv), 0.0, uv)
    if uv.ndim != 2 or uv.shape[1] < 2 or len(uv) <= faces.max():
        remedy = "Unwrap the mesh again, or take its texture away"
        raise _error(path, "a vertex has no two texture coordinates", remedy)
    return uv[faces][..., :2]


def _is_invented(material: Any, path: Path) -> bool:
    """Whether trimesh made the material up, with 2 x 2 texels of (100, 100, 100), for texture
    coordinates without one; GLB files that it exported hold it, too."""
    image = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
    if getattr(image, "size", None) != (2, 2) or getattr(material, "kwargs", None):
        return False
    return bool((np.asarray(picture(image, path)) == 100).all())


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


def _colours(visual: Any, faces: np.ndarray, path: Path) -> np.ndarray | None:
    """(T, 3, 3) linear vertex or face colours, None when the file has none."""
    from trimesh.visual.color import to_float

    kind = getattr(visual, "kind", None)
    if kind == "vertex":
        corner = np.asarray(visual.vertex_colors)[faces]
    elif kind == "face":
        corner = np.repeat(np.asarray(visual.face_colors)[:, None], 3, axis=1)
    else:
        attribute = getattr(visual, "vertex_attributes", {}).get("color")
        if attribute is None or len(attribute) <= faces.max():
            return None
        corner = np.asarray(attribute)[faces]
    colours = np.clip(to_float(corner[..., :3]), 0, 1)
    # Those of glTF are linear; everywhere else they are display values.
    return colours if path.suffix.lower() in SUFFIXES else srgb_decode(colours)


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


# -- triangle strips of PLY files, which trimesh reads as points without faces ------------------


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


def strip_faces(indices: np.ndarray) -> np.ndarray:
    """(T, 3) of a strip (V,): every three in a row, every other one turned; -1 starts anew."""
    indices = np.asarray(indices, np.int64).ravel()
    if len(indices) < 3:
        return np.zeros((0, 3), np.int64)
    at = np.arange(len(indices))
    started = np.maximum.accumulate(np.where(indices < 0, at, -1)) + 1
    faces = np.stack([indices[:-2], indices[1:-1], indices[2:]], axis=1)
    turned = (at - started)[:-2] % 2 == 1
    faces[turned] = faces[turned][:, [1, 0, 2]]
    a, b, c = faces.T
    return faces[(faces >= 0).all(1) & (a != b) & (b != c) & (c != a)]


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
