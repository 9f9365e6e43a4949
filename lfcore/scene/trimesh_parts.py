"""Parts of a trimesh.Scene: geometry, normals, textures, vertex colours, materials."""

from dataclasses import replace
from typing import Any

import numpy as np

from lfcore.colour import srgb_decode
from lfcore.errors import SceneError
from lfcore.reading import Where
from lfcore.scene.surface_mesh import Surface, SurfaceMesh, clipped, shaded

WHERE = Where("trimesh")


def parts_of(scene: Any) -> list[SurfaceMesh]:
    """Return the parts of a ``trimesh.Scene``.

    They have the scene's normals; else they are smooth except at edges beyond 40 degrees.
    """
    import trimesh  # the heaviest import of the package, not needed by procedural scenes

    try:
        nodes = [scene.graph[node] for node in scene.graph.nodes_geometry]
        meshes = [(matrix, scene.geometry[name]) for matrix, name in nodes]
    except (LookupError, TypeError, ValueError) as error:  # unknown names, cycles of nodes
        raise _error(f"its nodes cannot be placed: {error!r}") from error
    parts = [
        _part(mesh).transformed(np.asarray(matrix, np.float64))
        for matrix, mesh in meshes
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces)
    ]
    if not parts:
        raise _error("mesh holds no triangles", "Give triangles, not only points, lines or fans")
    return parts


def _error(problem: str, remedy: str = "Mend the mesh") -> SceneError:
    return WHERE.error(problem, remedy)


def _part(mesh: Any) -> SurfaceMesh:
    vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
    if vertices.ndim != 2 or vertices.shape[1] != 3:
        raise _error(f"vertices have the shape {vertices.shape}", "Give each vertex x, y and z")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise _error(f"face names vertex {int(faces.max())} of {len(vertices)}")
    # trimesh computes normals on demand; only those in the cache came with the mesh.
    normals = mesh._cache.cache.get("vertex_normals")
    if normals is not None:
        has_all = np.shape(normals) == vertices.shape
        normals = np.asarray(normals, np.float64)[faces] if has_all else None
    surface, colours = _surface(mesh.visual), _colours(mesh.visual, faces)
    if mesh.visual.kind in ("vertex", "face"):  # and no material
        surface = replace(surface, diffuse=(1.0,) * 3)
    uvs = _texture_coordinates(mesh.visual, faces) if surface.has_textures else None
    return shaded(SurfaceMesh(vertices[faces], surface, normals, uvs, colours), "auto", 40.0)


def _texture_coordinates(visual: Any, faces: np.ndarray) -> np.ndarray | None:
    """Return (T, 3, 2) of the corners; NaN of corners that are not unwrapped becomes 0."""
    if visual.uv is None or len(visual.uv) == 0:
        return None
    uv = np.nan_to_num(np.asarray(visual.uv, np.float64))
    if uv.ndim != 2 or uv.shape[1] < 2 or len(uv) <= faces.max():
        remedy = "Unwrap the mesh again, or take its texture away"
        raise _error("a vertex has no two texture coordinates", remedy)
    return uv[faces][..., :2]


def _surface(visual: Any) -> Surface:
    """Return the surface of a mesh's material.

    It has metal and roughness if the material has either or their texture, else it is matt; the
    default of ``metallic`` is 0.
    """
    from trimesh.visual.material import PBRMaterial, SimpleMaterial

    material = getattr(visual, "material", None)
    if isinstance(material, SimpleMaterial):
        material = material.to_pbr()
    if not isinstance(material, PBRMaterial):
        return Surface("trimesh")
    metallic, roughness = material.metallicFactor, material.roughnessFactor
    image = material.metallicRoughnessTexture
    is_physical = not (metallic is None and roughness is None and image is None)
    emission = material.emissiveFactor
    emission = (0.0,) * 3 if emission is None else clipped(np.asarray(emission, np.float64)[:3])
    surface = Surface(
        str(material.name or "trimesh"),
        clipped(_base_colour(material)),
        emission=emission,
        texture=_picture(material.baseColorTexture),
        metallic=_share(metallic, 0.0) if is_physical else -1.0,
        roughness=_share(roughness, 1.0),
        metal_texture=_picture(image),
        normal_texture=_picture(material.normalTexture),
        emission_texture=_picture(material.emissiveTexture) if any(emission) else None,
    )
    if not np.isfinite((*surface.diffuse, *surface.emission)).all():
        raise _error(f"material {surface.name!r} has a number that is not finite")
    return surface


def _picture(image: Any) -> np.ndarray | None:
    """Return (H, W, 3) uint8 of a Pillow image; None without one."""
    if image is None:
        return None
    try:
        return np.array(image.convert("RGB"), np.uint8)
    except Exception as error:  # Pillow raises many kinds on damaged images
        raise _error(f"texture cannot be decoded: {error}", "Replace the image") from error


def _share(value: Any, default: float) -> float:
    """Return a factor from 0 to 1."""
    if value is None:
        return default
    if not isinstance(value, (int, float)) or not abs(value) <= 1e308:
        raise _error(f"a material's factor is {str(value)[:40]!r}", "Give a finite number")
    return min(max(float(value), 0.0), 1.0)


def _base_colour(material: Any) -> np.ndarray:
    """Return (3,) base colour, which trimesh holds as floats or as whole numbers."""
    from trimesh.visual.color import to_float  # slow to import

    given = material.baseColorFactor
    given = np.zeros(0) if given is None else to_float(given)[:3]
    return np.append(given, np.ones(3 - len(given)))


def _colours(visual: Any, faces: np.ndarray) -> np.ndarray | None:
    """Return (T, 3, 3) linear, of sRGB colours of vertices or faces; None without them."""
    from trimesh.visual.color import to_float

    if visual.kind == "vertex":
        corner = np.asarray(visual.vertex_colors)[faces]
    elif visual.kind == "face":
        corner = np.repeat(np.asarray(visual.face_colors)[:, None], 3, axis=1)
    else:
        attribute = getattr(visual, "vertex_attributes", {}).get("color")
        if attribute is None or len(attribute) <= faces.max():
            return None
        corner = np.asarray(attribute)[faces]
    return srgb_decode(np.clip(to_float(corner[..., :3]), 0, 1))
