"""Shapes that the procedural models are made of; every one returns a SurfaceMesh.

World space, metres, y up.  Texture coordinates run in metres times ``repeat`` (textures per
metre) unless said otherwise, so that a brick has one size on every wall.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lfcore.scene.procedural.basics import Parts, Size
from lfcore.scene.surface_mesh import (
    Surface,
    SurfaceMesh,
    area_vectors,
    crease_normals,
    join,
    normalise,
    xyz,
)

UNIT_SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))


def quad(corners: ArrayLike, surface: Surface, uv: ArrayLike = UNIT_SQUARE) -> SurfaceMesh:
    """Two triangles over four corners in turn, counter-clockwise from outside."""
    corners, uv = np.asarray(corners, np.float64), np.asarray(uv, np.float64)
    order = [[0, 1, 2], [0, 2, 3]]
    return SurfaceMesh(corners[order], surface, None, uv[order])


def rectangle(
    origin: ArrayLike,
    across: ArrayLike,
    up: ArrayLike,
    surface: Surface,
    *,
    repeat: float | None = None,
    pieces: Size = (1, 1),
) -> SurfaceMesh:
    """A flat rectangle from ``origin`` along ``across`` and ``up``, cut into ``pieces``.

    ``repeat`` None stretches one texture over it.
    """
    origin, across, up = (np.asarray(v, np.float64) for v in (origin, across, up))
    a, b = np.meshgrid(np.linspace(0, 1, pieces[0] + 1), np.linspace(0, 1, pieces[1] + 1))
    points = origin + a[..., None] * across + b[..., None] * up
    uv = np.stack([a, b], -1)
    if repeat is not None:
        uv = uv * (np.linalg.norm(across) * repeat, np.linalg.norm(up) * repeat)
    return mesh_grid(points, surface, uv, smooth=False)


def mesh_grid(
    points: np.ndarray,
    surface: Surface,
    uv: np.ndarray | None = None,
    *,
    close_columns: bool = False,
    close_rows: bool = False,
    smooth: bool = True,
    crease_deg: float = 60.0,
) -> SurfaceMesh:
    """A sheet through (R, C, 3) ``points`` with ``uv`` (R, C, 2); zero-area triangles left out.

    Closed directions join the last row or column to the first; ``uv`` then has one row or
    column more than ``points``.
    """
    points = np.asarray(points, np.float64)
    if close_columns:
        points = np.concatenate([points, points[:, :1]], 1)
    if close_rows:
        points = np.concatenate([points, points[:1]], 0)
    triangles = _cells(points)
    edges = area_vectors(triangles)
    size = np.abs(points - points.mean((0, 1))).max()
    keep = np.abs(edges).max(1) > 1e-12 * size * size
    normals = crease_normals(triangles[keep], crease_deg) if smooth else None
    uvs = None if uv is None else _cells(np.asarray(uv, np.float64))[keep]
    return SurfaceMesh(triangles[keep], surface, normals, uvs)


def _cells(grid: np.ndarray) -> np.ndarray:
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    both = np.stack([np.stack([a, b, c], 2), np.stack([a, c, d], 2)], 2)
    return both.reshape(-1, 3, grid.shape[-1])


def box(
    size: ArrayLike,
    surface: Surface,
    *,
    centre: ArrayLike = (0, 0, 0),
    repeat: float = 1.0,
    grain: int = 0,
) -> SurfaceMesh:
    """12 triangles, flat shaded. The texture's u runs along axis ``grain`` where it can."""
    half, centre = np.asarray(size, np.float64) / 2, np.asarray(centre, np.float64)
    parts = []
    for sign, axis, first, second in _sides():
        corners = np.zeros((4, 3))
        corners[:, axis] = sign * half[axis]
        corners[:, first] = np.array([-1, 1, 1, -1]) * half[first]
        corners[:, second] = np.array([-1, -1, 1, 1]) * half[second]
        along = grain if axis != grain else first
        other = 3 - axis - along
        uv = (corners + half)[:, [along, other]] * repeat + (0.13 * axis, 0.37 * axis)
        parts.append(quad(corners + centre, surface, uv))
    return join(parts)


def _sides() -> Iterator[tuple[float, int, int, int]]:
    """Of a cube: the sign and axis of its normal, and two axes that it is right-handed with."""
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


def outline(text: str) -> np.ndarray:
    """(K, 2) float64 of ``"radius height, radius height, ..."``."""
    return np.array([pair.split() for pair in text.split(",")], np.float64)


def lathe(
    profile: ArrayLike | str,
    surface: Surface,
    *,
    segments: int = 24,
    repeat: float | None = None,
    crease_deg: float = 40.0,
) -> SurfaceMesh:
    """A profile of (radius, height) pairs, bottom to top outside, turned about the y axis.

    ``profile`` may be text, as of :func:`outline`; ``repeat`` None wraps one texture once around
    and once from the first to the last pair.
    """
    profile = outline(profile) if isinstance(profile, str) else np.asarray(profile, np.float64)
    angle = -np.arange(segments) * (2 * np.pi / segments)
    ring = xyz(np.cos(angle), 0.0, np.sin(angle))
    points = profile[:, :1, None] * ring[None]
    points[..., 1] = profile[:, 1:]
    length = np.r_[0, np.cumsum(np.linalg.norm(np.diff(profile, axis=0), axis=1))]
    u, v = np.linspace(0, 1, segments + 1), length / (length[-1] or 1.0)
    if repeat is not None:
        u, v = u * 2 * np.pi * profile[:, 0].max() * repeat, length * repeat
    uv = np.stack(np.meshgrid(u, v), -1)
    return mesh_grid(points, surface, uv, close_columns=True, crease_deg=crease_deg)


def sphere(
    radius: ArrayLike,
    surface: Surface,
    *,
    centre: ArrayLike = (0, 0, 0),
    segments: int = 16,
    rings: int = 10,
) -> SurfaceMesh:
    """An ellipsoid when ``radius`` is a triple; 2 * segments * (rings - 1) triangles."""
    latitude = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)
    across = np.cos(latitude)
    across[[0, -1]] = 0.0
    part = lathe(np.stack([across, np.sin(latitude)], -1), surface, segments=segments)
    radius = np.broadcast_to(np.asarray(radius, np.float64), 3)
    triangles, normals = part.triangles * radius, normalise(part.triangles / radius)
    return SurfaceMesh(triangles + np.asarray(centre, np.float64), surface, normals, part.uvs)


def tube(
    path: ArrayLike,
    radius: ArrayLike,
    surface: Surface,
    *,
    segments: int = 8,
    closed: bool = False,
    caps: bool = True,
    repeat: float = 1.0,
) -> SurfaceMesh:
    """A round tube along (K, 3) ``path``; ``radius`` a number or one for each point.

    Caps are cones of no height, so that one sheet covers all.
    """
    path = np.asarray(path, np.float64)
    radii = np.broadcast_to(np.asarray(radius, np.float64), len(path)).copy()
    length = np.r_[0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))]
    ahead = np.roll(path, -1, 0) - np.roll(path, 1, 0) if closed else np.gradient(path, axis=0)
    tangents = normalise(ahead)
    if caps and not closed:
        path = np.concatenate([path[:1], path, path[-1:]])
        radii = np.r_[0, radii, 0]
        tangents = np.concatenate([tangents[:1], tangents, tangents[-1:]])
        length = np.r_[0, length, length[-1]]
    right, up = _frames(tangents, closed)
    angle = np.arange(segments)[:, None] * (2 * np.pi / segments)
    ring = np.cos(angle) * right[:, None] + np.sin(angle) * up[:, None]
    points = path[:, None] + radii[:, None, None] * ring
    u = np.linspace(0, 1, segments + 1) * max(1.0, round(2 * np.pi * radii.max() * repeat))
    if closed:
        length = np.r_[length, length[-1] + np.linalg.norm(path[0] - path[-1])]
    uv = np.stack(np.meshgrid(u, length * repeat), -1)
    return mesh_grid(points, surface, uv, close_columns=True, close_rows=closed, crease_deg=70.0)


def _frames(tangents: np.ndarray, closed: bool) -> tuple[np.ndarray, np.ndarray]:
    """Right and up vectors carried along the path without twist (double reflection's limit)."""
    right = np.eye(3)[np.argmin(np.abs(tangents[0]))]
    rights = np.empty((len(tangents), 3))
    for number, tangent in enumerate(tangents):
        right = right - tangent * (right @ tangent)
        rights[number] = right = right / np.linalg.norm(right)
    if closed:
        # Spread the angle that remains between the last and the first frame over the loop.
        first, last = rights[0], rights[-1] - tangents[0] * (rights[-1] @ tangents[0])
        twist = np.arctan2(np.cross(last, first) @ tangents[0], last @ first)
        angle = np.linspace(0, twist, len(tangents))[:, None]
        rights = np.cos(angle) * rights + np.sin(angle) * np.cross(tangents, rights)
    return rights, np.cross(tangents, rights)


def cylinder(
    start: ArrayLike, end: ArrayLike, radius: ArrayLike, surface: Surface, **options: Any
) -> SurfaceMesh:
    """A straight tube; ``radius`` a number or a pair (a cone's); ``options`` of :func:`tube`."""
    return tube(np.array([start, end], np.float64), radius, surface, **options)


def ring(
    radius: float, number: int, *, centre: ArrayLike = (0, 0, 0), axis: str = "z"
) -> np.ndarray:
    """(number, 3) points on a circle about an axis, for closed tubes."""
    angle = np.arange(number) * (2 * np.pi / number)
    flat = xyz(np.cos(angle), np.sin(angle), 0.0) * radius
    order = {"z": [0, 1, 2], "y": [0, 2, 1], "x": [2, 0, 1]}[axis]
    return flat[:, order] + np.asarray(centre, np.float64)


def curve(points: Sequence[ArrayLike], number: int) -> np.ndarray:
    """(number, 3) points on a Catmull-Rom spline through ``points``, ends included."""
    p = np.asarray(points, np.float64)
    padded = np.concatenate([2 * p[:1] - p[1:2], p, 2 * p[-1:] - p[-2:-1]])
    position = np.linspace(0, len(p) - 1, number)
    index = np.minimum(position.astype(int), len(p) - 2)
    t = (position - index)[:, None]
    p0, p1, p2, p3 = (padded[index + k] for k in range(4))
    return 0.5 * (
        2 * p1
        + (p2 - p0) * t
        + (2 * p0 - 5 * p1 + 4 * p2 - p3) * t**2
        + (3 * p1 - p0 - 3 * p2 + p3) * t**3
    )


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
    centre: ArrayLike, normal: ArrayLike, radius: float, surface: Surface, *, segments: int = 10
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


def log(
    start: ArrayLike,
    end: ArrayLike,
    radius: float,
    bark: Surface,
    grain: Surface,
    *,
    segments: int = 8,
) -> Parts:
    """A trunk with sawn ends: 4 * segments triangles."""
    start, end = np.asarray(start, np.float64), np.asarray(end, np.float64)
    return [
        cylinder(start, end, radius, bark, segments=segments, caps=False),
        disc(start, start - end, radius, grain, segments=segments),
        disc(end, end - start, radius, grain, segments=segments),
    ]
