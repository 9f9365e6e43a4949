"""Parts of a trimesh.Scene: geometry, normals, textures, vertex colours, materials."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.colour import srgb_decode
from lfcore.errors import SceneError
from lfcore.reading import Where
from lfcore.scene.surface_mesh import Surface, SurfaceMesh, clipped, shaded


def _error(path: Path, problem: str, remedy: str = "Export the mesh again") -> SceneError:
    return Where(path).error(problem, remedy)


def parts_of(
    scene: Any,
    path: Path,
    *,
    shading: str = "auto",
    crease_deg: float = 40.0,
    remedy: str = "Export triangles, not only points, lines or fans",
) -> list[SurfaceMesh]:
    """The parts of a ``trimesh.Scene``; ``path`` names it in errors, ``remedy`` helps if there are
    none.

    ``shading`` is ``auto`` (the mesh's normals, else smoothed but for edges beyond ``crease_deg``),
    ``smooth`` or ``flat``.
    """
    import trimesh  # the heaviest import of the package, not needed by procedural scenes

    try:
        nodes = [scene.graph[node] for node in scene.graph.nodes_geometry]
        meshes = [(matrix, scene.geometry[name]) for matrix, name in nodes]
    except (LookupError, TypeError, ValueError) as error:  # unknown names, cycles of nodes
        raise _error(path, f"its nodes cannot be placed: {error!r}") from error
    parts, empty = [], True
    for matrix, mesh in meshes:
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
            empty = False
            surface, uvs = _surface(mesh.visual, np.asarray(mesh.faces, np.int64), path)
            part = _part(mesh, surface, uvs, path, shading, crease_deg)
            parts.append(part.transformed(np.asarray(matrix, np.float64)))
    if empty:
        raise _error(path, "mesh holds no triangles", remedy)
    return parts


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
    # trimesh computes normals on demand; only those in the cache came with the file.
    file_normals = mesh._cache.cache.get("vertex_normals")
    if file_normals is not None and np.shape(file_normals) != vertices.shape:
        file_normals = None
    normals = None if file_normals is None else np.asarray(file_normals, np.float64)[faces]
    colours = _colours(mesh.visual, faces, path)
    if getattr(mesh.visual, "kind", None) in ("vertex", "face"):  # and no material
        surface = replace(surface, diffuse=(1.0,) * 3)
    return shaded(SurfaceMesh(vertices[faces], surface, normals, uvs, colours), shading, crease_deg)


def _surface(visual: Any, faces: np.ndarray, path: Path) -> tuple[Surface, np.ndarray | None]:
    """Surface and texture coordinates (T, 3, 2) of a mesh."""
    from trimesh.visual.material import PBRMaterial, SimpleMaterial

    material = getattr(visual, "material", None)
    if _is_invented(material, path):
        material = None
    if isinstance(material, SimpleMaterial):
        material = material.to_pbr()
    if isinstance(material, PBRMaterial):
        surface = surface_of_pbr(material, path)
    else:
        surface = Surface(path.stem)
    values = (*surface.diffuse, *surface.specular, *surface.emission, surface.shininess)
    if not np.isfinite(values).all():
        problem = f"material {surface.name!r} has a number that is not finite"
        raise _error(path, problem, "Mend the material")
    uv = getattr(visual, "uv", None)
    if uv is None or len(uv) == 0:
        return surface, None
    try:
        return surface, _texture_coordinates(np.asarray(uv, np.float64), faces, path)
    except SceneError:
        if not surface.has_textures:
            return surface, None  # nothing is read there
        raise


def _texture_coordinates(uv: np.ndarray, faces: np.ndarray, path: Path) -> np.ndarray:
    """(T, 3, 2) of the corners; exporters write NaN for corners that are not unwrapped, read as
    0."""
    uv = np.where(np.isnan(uv), 0.0, uv)
    if uv.ndim != 2 or uv.shape[1] < 2 or len(uv) <= faces.max():
        remedy = "Unwrap the mesh again, or take its texture away"
        raise _error(path, "a vertex has no two texture coordinates", remedy)
    return uv[faces][..., :2]


def _is_invented(material: Any, path: Path) -> bool:
    """Whether trimesh invented the material, 2 x 2 texels of (100, 100, 100), for texture
    coordinates without a material."""
    image = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
    if getattr(image, "size", None) != (2, 2) or getattr(material, "kwargs", None):
        return False
    return bool((np.asarray(picture(image, path)) == 100).all())


def surface_of_pbr(material: Any, path: Path) -> Surface:
    """The surface of one of trimesh's PBRMaterials.

    It has metal and roughness if the material has either or their texture, else it is matt; the
    default of ``metallic`` is 0.
    """
    metallic, roughness = material.metallicFactor, material.roughnessFactor
    image = material.metallicRoughnessTexture
    is_physical = not (metallic is None and roughness is None and image is None)
    emission = np.zeros(3)
    if material.emissiveFactor is not None:
        emission = np.clip(np.asarray(material.emissiveFactor, np.float64)[:3], 0, 1)
    emits = bool(emission.any())
    return Surface(
        str(material.name or path.stem),
        clipped(factor(material)[:3]),
        emission=clipped(emission),
        texture=picture(material.baseColorTexture, path),
        metallic=_share(metallic, 0.0, path) if is_physical else -1.0,
        roughness=_share(roughness, 1.0, path),
        metal_texture=picture(image, path),
        normal_texture=picture(material.normalTexture, path),
        emission_texture=picture(material.emissiveTexture, path) if emits else None,
    )


def picture(image: Any, path: Path, mode: str = "RGB") -> np.ndarray | None:
    """(H, W, channels) uint8 of a Pillow image; None without one."""
    if image is None:
        return None
    try:
        return np.array(image.convert(mode), np.uint8)
    except Exception as error:  # Pillow raises many kinds on damaged images
        problem = f"texture cannot be decoded: {error}"
        raise Where(path).error(problem, "Replace the image") from error


def _number(value: Any, path: Path) -> float:
    if isinstance(value, (int, float)) and abs(value) <= 1e308:
        return float(value)
    problem = f"a material's factor is {str(value)[:40]!r}"
    raise Where(path).error(problem, "Give a finite number")


def _share(value: Any, otherwise: float, path: Path) -> float:
    """A factor from 0 to 1; ``otherwise`` where there is none."""
    return otherwise if value is None else min(max(_number(value, path), 0.0), 1.0)


def factor(material: Any) -> np.ndarray:
    """(4,) base colour and alpha, which trimesh holds as floats or as whole numbers."""
    from trimesh.visual.color import to_float  # slow to import

    given = material.baseColorFactor
    given = np.zeros(0) if given is None else to_float(given)[:4]
    return np.append(given, np.ones(4 - len(given)))


def _colours(visual: Any, faces: np.ndarray, path: Path) -> np.ndarray | None:
    """(T, 3, 3) linear, of sRGB colours of vertices or faces; None when the mesh has none."""
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
    return srgb_decode(np.clip(to_float(corner[..., :3]), 0, 1))
