"""Round shapes that the procedural models are made of: profiles that are turned, and tubes.

World space and texture coordinates: as in :mod:`lfcore.scene.procedural.primitives`.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lfcore.scene.procedural.basics import Parts, Vector
from lfcore.scene.procedural.primitives import disc, mesh_grid
from lfcore.scene.surface_mesh import Surface, SurfaceMesh, normalise, xyz


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

    ``profile`` may be a text for :func:`outline`; ``repeat`` None wraps one texture once around
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
    return mesh_grid(points, surface, (u, v), close_columns=True, crease_deg=crease_deg)


def sphere(
    radius: ArrayLike, surface: Surface, *, segments: int = 16, rings: int = 10
) -> SurfaceMesh:
    """An ellipsoid when ``radius`` is a triple; 2 * segments * (rings - 1) triangles."""
    latitude = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)
    across = np.cos(latitude)
    across[[0, -1]] = 0.0
    part = lathe(np.stack([across, np.sin(latitude)], -1), surface, segments=segments)
    radius = np.broadcast_to(np.asarray(radius, np.float64), 3)
    triangles, normals = part.triangles * radius, normalise(part.triangles / radius)
    return SurfaceMesh(triangles, surface, normals, part.uvs)


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
    uv = u, length * repeat
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
    start: Vector, end: Vector, radius: ArrayLike, surface: Surface, **options: Any
) -> SurfaceMesh:
    """A straight tube; ``radius`` a number or a pair (a cone's); ``options`` of :func:`tube`."""
    return tube(np.array([start, end], np.float64), radius, surface, **options)


def ring(radius: float, number: int) -> np.ndarray:
    """(number, 3) points on a circle about the z axis, for closed tubes."""
    angle = np.arange(number) * (2 * np.pi / number)
    return xyz(np.cos(angle), np.sin(angle), 0.0) * radius


def curve(points: Sequence[ArrayLike] | np.ndarray, number: int) -> np.ndarray:
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


def log(
    start: Vector, end: Vector, radius: float, bark: Surface, grain: Surface, *, segments: int = 8
) -> Parts:
    """A trunk with sawn ends: 4 * segments triangles."""
    start, end = np.asarray(start, np.float64), np.asarray(end, np.float64)
    return [
        cylinder(start, end, radius, bark, segments=segments, caps=False),
        disc(start, start - end, radius, grain, segments=segments),
        disc(end, end - start, radius, grain, segments=segments),
    ]
