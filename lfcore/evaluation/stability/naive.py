"""Textbook methods in float32, as they are usually written, for comparison."""

import numpy as np
from numpy.typing import ArrayLike

from lfcore.scene.model import Scene

F = np.float32
Vectors = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Vectors by coordinate."""


def moeller_trumbore(
    triangles: np.ndarray, origins: np.ndarray, directions: np.ndarray, *, epsilon: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Closest (triangle, t) by brute force, (R,) int64 and float32; -1 and inf for a miss.

    T. Moeller, B. Trumbore, "Fast, minimum storage ray/triangle intersection", 1997; triangles
    of a determinant of at most ``epsilon`` are culled, as in the paper.
    """
    p, q, r = (np.asarray(triangles, F)[:, k].T for k in range(3))  # (3, T) each
    edge_1, edge_2 = q - p, r - p
    best = np.full(len(origins), np.inf, F)
    number = np.full(len(origins), -1)
    step = max(1, (1 << 18) // max(1, p.shape[1]))
    with np.errstate(all="ignore"):
        for first in range(0, len(origins) if p.size else 0, step):
            part = slice(first, first + step)
            origin = np.asarray(origins[part], F).T[:, :, None]
            direction = np.asarray(directions[part], F).T[:, :, None]
            across = _cross(direction, edge_2[:, None])
            determinant = _dot(edge_1[:, None], across)
            inverse = F(1) / determinant
            offset = origin - p[:, None]
            u = _dot(offset, across) * inverse
            normal = _cross(offset, edge_1[:, None])
            v = _dot(direction, normal) * inverse
            t = _dot(edge_2[:, None], normal) * inverse
            hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0)
            hit &= np.abs(determinant) > epsilon
            t = np.where(hit, t, F(np.inf))
            rows, at = np.arange(len(t)), np.argmin(t, axis=1)
            best[part] = t[rows, at]
            number[part] = np.where(hit[rows, at], at, -1)
    return number, best


def _cross(a: Vectors | np.ndarray, b: Vectors | np.ndarray) -> Vectors:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def _dot(a: Vectors | np.ndarray, b: Vectors | np.ndarray) -> np.ndarray:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def slab_test(
    lo: np.ndarray, hi: np.ndarray, origins: np.ndarray, directions: np.ndarray
) -> np.ndarray:
    """(R,) bool: whether rays hit the boxes (R, 3), by reciprocals and without a margin.

    T. L. Kay, J. T. Kajiya, "Ray tracing complex scenes", 1986.
    """
    with np.errstate(all="ignore"):
        inverse = F(1) / np.asarray(directions, F)
        near, far = (lo - origins) * inverse, (hi - origins) * inverse
        enter = np.minimum(near, far).max(1)
        leave = np.maximum(near, far).min(1)
        return (enter <= leave) & (leave >= 0)


def sphere(
    centre: ArrayLike, radius: float, origins: np.ndarray, directions: np.ndarray
) -> np.ndarray:
    """(R,) float32 distance to a sphere by the quadratic formula; NaN for a miss."""
    with np.errstate(all="ignore"):
        offset = np.asarray(origins, F) - np.asarray(centre, F)
        directions = np.asarray(directions, F)
        a = (directions**2).sum(1, dtype=F)
        b = F(2) * (offset * directions).sum(1, dtype=F)
        c = (offset**2).sum(1, dtype=F) - F(radius) ** 2
        return (-b - np.sqrt(b * b - F(4) * a * c)) / (F(2) * a)


OFFSET = 1e-4
"""How far a ray starts from the surface that it leaves, metres."""
STEPS = 9
"""The surfaces of a path."""


def whitted(
    scene: Scene, origins: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Light and unfolded length, (R,), of the strongest path over mirrors and glass.

    T. Whitted, "An improved illumination model for shaded display", 1980, with Schlick's
    approximation of Fresnel's equations; rays start 0.1 mm from a surface.
    """
    origin, along = np.asarray(origins, F), np.asarray(directions, F)
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    light, length, weight = (np.zeros(len(origin), F) for _ in range(3))
    weight += 1
    mesh = scene.triangles
    normals = np.cross(mesh[:, 1] - mesh[:, 0], mesh[:, 2] - mesh[:, 0])
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    columns = {
        name: np.array([getattr(m, name) for m in scene.materials], F)[scene.material_ids]
        for name in ("transmission", "ior", "metallic")
    }
    colours = {
        name: np.array([getattr(m, name)[0] for m in scene.materials], F)[scene.material_ids]
        for name in ("diffuse", "emission")
    }
    for step in range(STEPS):
        number, t = moeller_trumbore(mesh, origin, along)
        hit = (number >= 0) & (weight > 0)
        weight, t = np.where(hit, weight, F(0)), np.where(hit, t, F(0))
        length += t
        n = normals[number]
        cosine = -(n * along).sum(1)
        n, front = n * np.sign(cosine)[:, None], cosine > 0
        cosine = np.abs(cosine)
        is_glass, is_mirror = columns["transmission"][number] > 0, columns["metallic"][number] > 0
        light += np.where(step > 0, weight * colours["emission"][number], 0)
        eta = np.where(front, 1 / columns["ior"][number], columns["ior"][number])
        base = ((eta - 1) / (eta + 1)) ** 2
        reflected = base + (1 - base) * (1 - cosine) ** 5
        square = 1 - eta**2 * (1 - cosine**2)
        mirrored = along + 2 * cosine[:, None] * n
        passed = eta[:, None] * along + (eta * cosine - np.sqrt(np.maximum(square, 0)))[:, None] * n
        goes_through = is_glass & (square > 0) & (reflected < 0.5)
        origin = origin + t[:, None] * along
        along = np.where(goes_through[:, None], passed, mirrored).astype(F)
        origin = (origin + F(OFFSET) * along).astype(F)
        share = np.where(is_glass, np.where(goes_through, 1 - reflected, reflected), 0)
        weight = weight * np.where(is_mirror, colours["diffuse"][number], share).astype(F)
    return light, length
