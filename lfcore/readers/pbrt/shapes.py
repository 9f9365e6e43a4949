"""pbrt shapes as triangles, in object space, float64.

Curved shapes are tessellated so that no triangle leaves its surface by more than
:data:`TOLERANCE` times the radius; normals are the surface's own.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy import sparse

from lfcore.errors import SceneError
from lfcore.readers.account import Account
from lfcore.readers.pbrt.parameters import ParameterSet
from lfcore.readers.ply import part_of
from lfcore.readers.ply_elements import Ply
from lfcore.reading import LARGEST_MESH, read_bytes
from lfcore.scene.notes import LEFT_OUT, NOT_USED
from lfcore.scene.surface_mesh import Surface, SurfaceMesh, grid_triangles, normalise, xyz

TOLERANCE = 1e-3
"""The largest distance of triangles from a curved shape, in its radii."""
# Corners of a triangle without texture coordinates, as pbrt gives them.
_DEFAULT_UVS = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])


def tessellate(kind: str, parameters: ParameterSet, folder: Path) -> SurfaceMesh | None:
    """The triangles of ``Shape "kind"``; None and a note for a shape that is not mapped."""
    shapes: dict[str, Callable[[ParameterSet], SurfaceMesh]] = {
        "trianglemesh": _trianglemesh, "plymesh": partial(_plymesh, folder=folder),
        "loopsubdiv": _loopsubdiv, "sphere": _sphere, "disk": _disk, "cylinder": _cylinder,
    }  # fmt: skip
    if kind not in shapes:
        parameters.note(LEFT_OUT, f'Shape "{kind}"')
        return None
    for name in ("alpha", "shadowalpha"):
        if parameters.get(name):
            parameters.approximated(f'"{name}", opaque', name)
    mesh = shapes[kind](parameters)
    if parameters.get("S"):
        parameters.note(NOT_USED, f'"S" (tangents) of {parameters.owner}')
    parameters.note_unused()
    return mesh


def with_uvs(mesh: SurfaceMesh) -> np.ndarray:
    """(T, 3, 2): the mesh's texture coordinates, or pbrt's default for each triangle."""
    if mesh.uvs is not None:
        return mesh.uvs
    return np.broadcast_to(_DEFAULT_UVS, (len(mesh.triangles), 3, 2))


def _indexed(
    points: np.ndarray, faces: np.ndarray, normals: np.ndarray | None, uvs: np.ndarray | None
) -> SurfaceMesh:
    picked = (None if values is None else values[faces] for values in (normals, uvs))
    return SurfaceMesh(points[faces], Surface(), *picked)


def _faces(parameters: ParameterSet, count: int) -> np.ndarray:
    indices = parameters.indices("indices")
    if indices is None:
        if count == 3:
            return np.array([[0, 1, 2]])
        raise parameters.error("indices", "is missing")
    if len(indices) % 3:
        raise parameters.error("indices", f"has {len(indices)} values, not a multiple of 3")
    if len(indices) and (indices.min() < 0 or indices.max() >= count):
        wrong = int(indices[(indices < 0) | (indices >= count)][0])
        raise parameters.error("indices", f"holds {wrong}, but there are {count} points")
    return indices.reshape(-1, 3)


def _trianglemesh(parameters: ParameterSet) -> SurfaceMesh:
    points = _points(parameters)
    normals = parameters.vectors("N")
    uvs = parameters.pairs("uv")
    uvs = parameters.pairs("st") if uvs is None else uvs
    for name, values in (("N", normals), ("uv", uvs)):
        if values is not None and len(values) != len(points):
            raise parameters.error(name, f"has {len(values)} entries for {len(points)} points")
    return _indexed(points, _faces(parameters, len(points)), normals, uvs)


def _points(parameters: ParameterSet) -> np.ndarray:
    points = parameters.vectors("P")
    if points is None:
        raise parameters.error("P", "is missing")
    return points


def _plymesh(parameters: ParameterSet, folder: Path) -> SurfaceMesh:
    name = parameters.string("filename")
    if name is None:
        raise parameters.error("filename", "is missing", "Name the PLY file")
    place, path = parameters.items["filename"].place, folder / name
    try:
        account = Account(parameters.notebook, path)
        part, _ = part_of(Ply(read_bytes(path, LARGEST_MESH)), account)
        if not part.count:
            raise ValueError("it holds no faces")
    except SceneError as error:
        raise place.error(f"PLY file {str(path)!r}: {error.problem}") from error
    except ValueError as error:
        raise place.error(f"PLY file {str(path)!r} cannot be read: {error}") from error
    account.close()
    return replace(part, colours=None)  # pbrt has no use for them


def _loopsubdiv(parameters: ParameterSet) -> SurfaceMesh:
    points = _points(parameters)
    levels = parameters.integer("levels", parameters.integer("nlevels", 3))
    if not 0 <= levels <= 10:
        raise parameters.error("levels", f"must be from 0 to 10, not {levels}")
    parameters.get("scheme")
    limit, faces, normals = loop_subdivide(points, _faces(parameters, len(points)), levels)
    return _indexed(limit, faces, normals, None)


def _angle_steps(angle: float, share: float = 1.0) -> int:
    """Return the number of chords that approximate an arc within a share of the tolerance."""
    step = 2.0 * math.acos(1.0 - share * TOLERANCE)
    return max(3 if angle > 6 else 1, math.ceil(angle / step - 1e-9))


def _radius(parameters: ParameterSet) -> float:
    radius = parameters.float("radius", 1.0)
    if not radius > 0:
        raise parameters.error("radius", f"must be above 0, not {radius}")
    return radius


def _sphere(parameters: ParameterSet) -> SurfaceMesh:
    radius = _radius(parameters)
    ends = [parameters.float("zmin", -radius), parameters.float("zmax", radius)]
    low, high = (min(max(z, -radius), radius) for z in (min(ends), max(ends)))
    start, stop = math.acos(low / radius), math.acos(high / radius)
    # Both directions are curved: each gets half of the tolerance.
    rows = _angle_steps(start - stop, 0.5)
    theta = np.linspace(start, stop, rows + 1)[:, None]
    # sin(pi) is not zero in floating point, but a pole must be one point.
    sine = np.where(np.isclose(np.abs(np.cos(theta)), 1.0, atol=1e-15), 0.0, np.sin(theta))
    x, y = _circle(parameters, 0.5)
    outward = xyz(sine * x, sine * y, np.cos(theta))
    return _turned(radius * outward, outward)


def _disk(parameters: ParameterSet) -> SurfaceMesh:
    reach = np.array([_radius(parameters), parameters.float("innerradius", 0.0)])[:, None]
    height = parameters.float("height", 0.0)
    x, y = _circle(parameters)
    return _turned(xyz(reach * x, reach * y, height), xyz(0.0, 0.0, np.ones_like(reach * x)))


def _cylinder(parameters: ParameterSet) -> SurfaceMesh:
    radius = _radius(parameters)
    z = np.sort([parameters.float("zmin", -1.0), parameters.float("zmax", 1.0)])[:, None]
    x, y = _circle(parameters)
    return _turned(xyz(radius * x, radius * y, z), xyz(x, y, 0.0 * z))


def _circle(parameters: ParameterSet, share: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Return x and y (1, C) on the unit circle up to ``phimax``, with a share of the tolerance."""
    phi_max = math.radians(min(max(parameters.float("phimax", 360.0), 0.0), 360.0))
    phi = np.linspace(0.0, phi_max, _angle_steps(phi_max, share) + 1)[None, :]
    if phi_max >= 2 * math.pi * (1 - 1e-12):  # all the way round: closed to the last bit
        phi[:, -1] = 0.0
    return np.cos(phi), np.sin(phi)


def _turned(points: np.ndarray, normals: np.ndarray) -> SurfaceMesh:
    """Return the triangles of a grid of points and normals (R, C, 3), without degenerate ones; u is
    along columns and v along rows."""
    uv = np.meshgrid(*(np.linspace(0, 1, count) for count in points.shape[1::-1]))
    corners, *attributes = (grid_triangles(grid) for grid in (points, normals, np.stack(uv, -1)))
    same = (corners == np.roll(corners, -1, axis=1)).all(-1).any(-1)
    return SurfaceMesh(corners[~same], Surface(), *(values[~same] for values in attributes))


def loop_subdivide(
    points: np.ndarray, faces: np.ndarray, levels: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Subdivide (P, 3) points and (F, 3) faces ``levels`` times, then push every vertex to the
    limit surface, and give it a unit normal."""
    for _ in range(levels):
        points, faces = _subdivide(points, faces)
    edges, _, is_open = _edges(faces)
    limit = _moved(points, edges, is_open, limit=True)
    a, b, c = limit[faces].swapaxes(0, 1)
    normals = np.zeros_like(limit)
    np.add.at(normals, faces, np.cross(b - a, c - a)[:, None])
    return limit, faces, normalise(normals)


def _edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return unique edges (E, 2), the edge of each face side (F, 3), and a mask of the boundary."""
    sides = np.sort(np.stack([faces, np.roll(faces, -1, 1)], -1).reshape(-1, 2), 1)
    edges, inverse, uses = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    if (uses > 2).any():
        raise SceneError("a subdivision mesh has an edge shared by more than two triangles")
    return edges, inverse.reshape(-1, 3), uses == 1


def _moved(
    points: np.ndarray, edges: np.ndarray, is_open: np.ndarray, *, limit: bool = False
) -> np.ndarray:
    """Return the vertices after a subdivision, or on the limit surface: weighted means with their
    neighbours, on a boundary with their neighbours along it."""

    def neighbours(edges: np.ndarray) -> sparse.csr_matrix:
        shape = len(points), len(points)
        half = sparse.coo_matrix((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape)
        return (half + half.T).tocsr()

    ring, along = neighbours(edges), neighbours(edges[is_open])
    valence = np.diff(ring.indptr)[:, None]
    share = np.where(valence == 3, 3.0 / 16.0, 3.0 / (8.0 * np.maximum(valence, 1)))
    if limit:
        share = 1.0 / (valence + 3.0 / (8.0 * share))
    rim = 0.2 if limit else 0.125
    inside = (1 - valence * share) * points + share * (ring @ points)
    edge = (1 - 2 * rim) * points + rim * (along @ points)
    return np.where((np.diff(along.indptr) > 0)[:, None], edge, inside)


def _subdivide(points: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    edges, side_edge, is_open = _edges(faces)
    # An edge point is 3/8 of its ends and 1/8 of the opposite corners; on a boundary the middle.
    opposite = np.zeros((len(edges), 3))
    np.add.at(opposite, side_edge, points[np.roll(faces, -2, 1)])
    ends = points[edges].sum(1)
    odd = np.where(is_open[:, None], 0.5 * ends, 0.375 * ends + 0.125 * opposite)
    a, b, c = faces.T
    ab, bc, ca = (len(points) + side_edge).T
    corners = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    even = _moved(points, edges, is_open)
    return np.concatenate([even, odd]), np.concatenate([np.stack(f, -1) for f in corners])
