"""Meshes and rays of the cases: rays have O = (x, y, 0) and D = (x, y, 1), float32."""

import numpy as np
from numpy.typing import ArrayLike

Rays = tuple[np.ndarray, np.ndarray]
"""Origins and directions, (R, 3) each."""


def single(values: ArrayLike) -> np.ndarray:
    """A copy in float32."""
    return np.array(values, np.float32)


def grid(
    columns: int, rows: int, corner: ArrayLike, across: ArrayLike, down: ArrayLike
) -> np.ndarray:
    """(2 columns rows, 3, 3) float64: the parallelogram at ``corner`` in triangles."""
    u = np.linspace(0, 1, columns + 1)[None, :, None]
    v = np.linspace(0, 1, rows + 1)[:, None, None]
    p = np.asarray(corner, float) + u * np.asarray(across, float) + v * np.asarray(down, float)
    a, b, c, d = p[:-1, :-1], p[:-1, 1:], p[1:, :-1], p[1:, 1:]
    halves = [np.stack([a, b, c], 2), np.stack([b, d, c], 2)]
    return np.concatenate([half.reshape(-1, 3, 3) for half in halves])


def sphere(
    rows: int, columns: int, radius: float = 1.0, centre: ArrayLike = (0.0, 0.0, 0.0)
) -> np.ndarray:
    """(T, 3, 3) float64: closed, the poles of valence ``columns`` on the z axis.

    Corners that are shared are equal to the last bit, also once rounded.
    """
    theta = np.linspace(0, np.pi, rows + 1)[:, None]
    phi = np.linspace(0, 2 * np.pi, columns, endpoint=False)[None, :]
    ring = np.sin(theta)
    ring[0] = ring[-1] = 0.0
    p = np.stack([ring * np.cos(phi), ring * np.sin(phi), np.cos(theta) + 0 * phi], -1)
    p = np.concatenate([p, p[:, :1]], axis=1) * radius + np.asarray(centre, float)
    a, b, c, d = p[:-1, :-1], p[:-1, 1:], p[1:, :-1], p[1:, 1:]
    lower = np.stack([a, c, b], 2)[1:]
    upper = np.stack([b, c, d], 2)[:-1]
    return np.concatenate([lower.reshape(-1, 3, 3), upper.reshape(-1, 3, 3)])


def rays_at(points: np.ndarray, origins: ArrayLike) -> Rays:
    """Rays from (s, t, 0), ``origins`` (2,) or (R, 2), towards ``points`` (R, 3), z > 0."""
    origins = np.broadcast_to(np.asarray(origins, np.float32), (len(points), 2))
    slope = (points[:, :2] - origins.astype(float)) / points[:, 2:]
    return at_depth(origins, 0.0).astype(np.float32), at_depth(slope, 1.0).astype(np.float32)


def at_depth(points: np.ndarray, z: float) -> np.ndarray:
    """(R, 3) float64: points (R, 2) at depth ``z``."""
    return np.concatenate([points, np.full((len(points), 1), z)], 1)


def one_by_one(rays: Rays) -> Rays:
    """Rays of any arrangement (..., 3) as rows."""
    origins, directions = (part.reshape(-1, 3) for part in rays)
    return origins, directions


def random_rays(count: int) -> Rays:
    """Rays from a lens of 25 mm over tangents within 0.4."""
    rng = np.random.default_rng(0)
    targets = at_depth(rng.uniform(-0.4, 0.4, (count, 2)), 1.0)
    return rays_at(targets, rng.uniform(-0.0125, 0.0125, (count, 2)))


def soup(count: int, depth: float = 3.0) -> np.ndarray:
    """(count, 3, 3) float64 triangles of 0.1 m in a cube of side 2 at ``depth``."""
    rng = np.random.default_rng(0)
    centres = rng.uniform(-1, 1, (count, 1, 3)) + [0, 0, depth]
    return centres + rng.normal(0, 0.1, (count, 3, 3))
