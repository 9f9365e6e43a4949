"""Flat shapes that the procedural models are made of, and copies of parts; round shapes are in
:mod:`lfcore.scene.procedural.turned`.

World space, metres, y up.  Texture coordinates run in metres times ``repeat`` (textures per
metre) unless said otherwise, so that a brick has one size on every wall.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike

from lfcore.scene.procedural.basics import Vector
from lfcore.scene.surface_mesh import (
    Surface,
    SurfaceMesh,
    area_vectors,
    crease_normals,
    grid_triangles,
    join,
    normalise,
)

UNIT_SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))


def quad(corners: ArrayLike, surface: Surface, uv: ArrayLike = UNIT_SQUARE) -> SurfaceMesh:
    """Two triangles over four corners in turn, counter-clockwise from outside."""
    corners, uv = np.asarray(corners, np.float64), np.asarray(uv, np.float64)
    order = [[0, 1, 2], [0, 2, 3]]
    return SurfaceMesh(corners[order], surface, None, uv[order])


def rectangle(
    origin: Vector, across: Vector, up: Vector, surface: Surface, *, repeat: float | None = None
) -> SurfaceMesh:
    """A flat rectangle from ``origin`` along ``across`` and ``up``.

    ``repeat`` None stretches one texture over it.
    """
    origin, across, up = (np.asarray(v, np.float64) for v in (origin, across, up))
    uv = np.array(UNIT_SQUARE)
    if repeat is not None:
        uv *= np.linalg.norm(across) * repeat, np.linalg.norm(up) * repeat
    return quad([origin, origin + across, origin + across + up, origin + up], surface, uv)


def mesh_grid(
    points: np.ndarray,
    surface: Surface,
    uv: np.ndarray | tuple[ArrayLike, ArrayLike] | None = None,
    *,
    close_columns: bool = False,
    close_rows: bool = False,
    smooth: bool = True,
    crease_deg: float = 60.0,
) -> SurfaceMesh:
    """A sheet through (R, C, 3) ``points`` with ``uv`` (R, C, 2), or u of the columns and v of the
    rows; zero-area triangles left out.

    Closed directions join the last row or column to the first; ``uv`` then has one row or
    column more than ``points``.
    """
    points = np.asarray(points, np.float64)
    if close_columns:
        points = np.concatenate([points, points[:, :1]], 1)
    if close_rows:
        points = np.concatenate([points, points[:1]], 0)
    if isinstance(uv, tuple):
        uv = np.stack(np.meshgrid(*uv), -1)
    triangles = grid_triangles(points)
    edges = area_vectors(triangles)
    size = np.abs(points - points.mean((0, 1))).max()
    keep = np.abs(edges).max(1) > 1e-12 * size * size
    normals = crease_normals(triangles[keep], crease_deg) if smooth else None
    uvs = None if uv is None else grid_triangles(np.asarray(uv, np.float64))[keep]
    return SurfaceMesh(triangles[keep], surface, normals, uvs)


def box(size: ArrayLike, surface: Surface, *, repeat: float = 1.0, grain: int = 0) -> SurfaceMesh:
    """12 triangles about the origin, flat shaded. The texture's u runs along axis ``grain`` where
    it can."""
    half = np.asarray(size, np.float64) / 2
    parts = []
    for sign, axis, first, second in _sides():
        corners = np.zeros((4, 3))
        corners[:, axis] = sign * half[axis]
        corners[:, first] = np.array([-1, 1, 1, -1]) * half[first]
        corners[:, second] = np.array([-1, -1, 1, 1]) * half[second]
        along = grain if axis != grain else first
        third = 3 - axis - along
        uv = (corners + half)[:, [along, third]] * repeat + (0.13 * axis, 0.37 * axis)
        parts.append(quad(corners, surface, uv))
    return join(parts)


def _sides() -> Iterator[tuple[float, int, int, int]]:
    """The sides of a cube: sign and axis of the normal, and two axes that make it right-handed."""
    for axis in range(3):
        first, second = (axis + 1) % 3, (axis + 2) % 3
        yield from ((-1.0, axis, second, first), (1.0, axis, first, second))


def cushion(
    size: ArrayLike, surface: Surface, *, pieces: int = 12, power: float = 4.0, repeat: float = 1.0
) -> SurfaceMesh:
    """A box with rounded edges (superellipsoid of ``power``): pillow at 2.5, crate at 10.

    12 * pieces^2 triangles; the texture is laid on from the nearest of six sides.
    """
    half = np.asarray(size, np.float64) / 2
    steps = np.tan(np.linspace(-np.pi / 4, np.pi / 4, pieces + 1))
    a, b = np.meshgrid(steps, steps)
    parts = []
    for sign, axis, first, second in _sides():
        cube = np.zeros((*a.shape, 3))
        cube[..., axis], cube[..., first], cube[..., second] = sign, a, b
        radius = (np.abs(cube) ** power).sum(-1, keepdims=True) ** (-1 / power)
        points = cube * radius * half
        # Upright and unmirrored on every side as seen from outside.
        along = points[..., ([2, 1], [0, 2], [0, 1])[axis]]
        flip = ((-sign, 1.0), (1.0, -sign), (sign, 1.0))[axis]
        parts.append(mesh_grid(points, surface, along * flip * repeat + 0.5, smooth=False))
    whole = join(parts)
    # The six sides meet at equal positions up to rounding; make them equal to smooth across.
    triangles = np.round(whole.triangles, 9)
    return SurfaceMesh(triangles, surface, crease_normals(triangles, 60.0), whole.uvs)


def scattered(part: SurfaceMesh, matrices: np.ndarray) -> SurfaceMesh:
    """``part`` repeated under (K, 4, 4) rigid or uniformly scaled matrices, as one part."""
    matrices = np.asarray(matrices, np.float64)
    linear, offset = matrices[:, None, None, :3, :3], matrices[:, None, None, :3, 3]

    def moved(vectors: np.ndarray) -> np.ndarray:
        return (linear @ vectors[None, ..., None])[..., 0]

    triangles = (moved(part.triangles) + offset).reshape(-1, 3, 3)
    normals = None if part.normals is None else moved(part.normals).reshape(-1, 3, 3)
    uvs = None if part.uvs is None else np.tile(part.uvs, (len(matrices), 1, 1))
    return SurfaceMesh(triangles, part.surface, normals, uvs)


def disc(
    centre: Vector, normal: Vector, radius: float, surface: Surface, *, segments: int = 10
) -> SurfaceMesh:
    """A flat fan; one texture over its bounding square."""
    y = normalise(np.asarray(normal, np.float64))
    x = normalise(np.cross(y, np.eye(3)[np.argmin(np.abs(y))]))
    angle = np.arange(segments + 1) * (2 * np.pi / segments)
    flat = np.stack([np.cos(angle), np.sin(angle)], -1)
    flat[-1] = flat[0]
    rim = np.asarray(centre) + radius * (flat[:, :1] * x + flat[:, 1:] * np.cross(y, x))
    hub = np.broadcast_to(np.asarray(centre, np.float64), rim[:-1].shape)
    uv = np.stack([np.full((segments, 2), 0.5), flat[:-1] / 2 + 0.5, flat[1:] / 2 + 0.5], 1)
    return SurfaceMesh(np.stack([hub, rim[:-1], rim[1:]], 1), surface, None, uv)
