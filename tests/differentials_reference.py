"""Ray differentials: how a path moves with the lens point (s, t) and with the pixel (x, y).

A ray starts at O = (s, t, 0) in direction D = (x - s delta, y - t delta, 1).  Its differentials are
those of a point on it and of its unit direction, (R, 4, 3) each, for s, t, x and y.

A thing in focus at inverse depth 1/z moves over the pixels by dx/ds = delta - 1/z.  Where the lens
point changes, the pixel that keeps the path's end in place has dx/ds = -(dQ/dx)^-1 dQ/ds, a 2 x 2
matrix, with Q the end; half its trace gives the inverse depth at which the end appears.

Source: H. Igehy, "Tracing ray differentials", SIGGRAPH 1999.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lfcore.oracle.textures import Spots


@dataclass(frozen=True)
class Differentials:
    """``point`` and ``direction``, (R, 4, 3) each."""

    point: np.ndarray
    direction: np.ndarray

    @classmethod
    def of_camera(cls, directions: np.ndarray, delta: float) -> Differentials:
        """The differentials of rays from the lens in ``directions`` (R, 3), whose z is 1."""
        steps = np.zeros((2, 4, 3))
        steps[0, [0, 1], [0, 1]] = 1
        steps[1, [0, 1], [0, 1]] = -delta
        steps[1, [2, 3], [0, 1]] = 1
        rays = len(directions)
        point, turned = (np.tile(step, (rays, 1, 1)) for step in steps)
        length = np.linalg.norm(directions, axis=1)[:, None, None]
        unit = directions[:, None] / length
        return cls(point, (turned - dot(turned, unit) * unit) / length)

    def some(self, mask: np.ndarray) -> Differentials:
        return Differentials(self.point[mask], self.direction[mask])

    def moved(self, t: np.ndarray, direction: np.ndarray, plane: np.ndarray) -> Differentials:
        """At the distance ``t`` (R,), on planes with normals ``plane`` (R, 3)."""
        shifted = self.point + t[:, None, None] * self.direction
        along, plane = direction[:, None], plane[:, None]
        return Differentials(
            shifted - dot(shifted, plane) / dot(along, plane) * along, self.direction
        )

    def mirrored(
        self, direction: np.ndarray, normal: np.ndarray, bends: np.ndarray
    ) -> Differentials:
        """After reflection; ``bends`` (R, 4, 3) is the differential of the unit ``normal``."""
        along, normal = direction[:, None], normal[:, None]
        change = dot(self.direction, normal) + dot(along, bends)
        turned = self.direction - 2 * (dot(along, normal) * bends + change * normal)
        return Differentials(self.point, turned)

    def refracted(
        self, direction: np.ndarray, normal: np.ndarray, bends: np.ndarray, eta: np.ndarray
    ) -> Differentials:
        """After refraction; ``eta`` (R,) is the index in front over that behind, and ``normal`` is
        in front."""
        along, normal, eta = direction[:, None], normal[:, None], eta[:, None, None]
        cosine = dot(along, normal)
        behind = -np.sqrt(np.maximum(1 - eta**2 * (1 - cosine**2), 1e-300))
        change = dot(self.direction, normal) + dot(along, bends)
        factor = eta * cosine - behind
        changed = (eta - eta**2 * cosine / behind) * change
        return Differentials(self.point, eta * self.direction - factor * bends - changed * normal)

    def inverse_depths(self, direction: np.ndarray, delta: float, at_end: np.ndarray) -> np.ndarray:
        """(R, 2, 2) matrices of dioptres at which the ends of paths appear.

        Paths end at their points where ``at_end`` (R,), else at infinity in their direction.
        """
        ends = np.where(at_end[:, None, None], self.point, self.direction)
        # Two of three coordinates suffice; the longest of the direction is left out.
        kept = np.argsort(np.abs(direction), axis=1)[:, None, :2]
        # A change along the ray does not change the point that is seen.
        along = direction[:, None]
        across = ends - dot(ends, along) * along
        both = np.take_along_axis(across, kept, axis=2)
        lens, pixel = both[:, :2].swapaxes(1, 2), both[:, 2:].swapaxes(1, 2)
        with np.errstate(all="ignore"):
            cross = pixel[:, 0, 0] * pixel[:, 1, 1] - pixel[:, 0, 1] * pixel[:, 1, 0]
            inverse = np.empty_like(pixel)
            inverse[:, 0, 0], inverse[:, 1, 1] = pixel[:, 1, 1], pixel[:, 0, 0]
            inverse[:, 0, 1], inverse[:, 1, 0] = -pixel[:, 0, 1], -pixel[:, 1, 0]
            slopes = -(inverse / cross[:, None, None]) @ lens
        return delta * np.eye(2) - slopes


def normal_bends(spots: Spots, moves: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """(R, 4, 3) differential of the interpolated unit ``normal`` (R, 3), with points that move by
    ``moves`` (R, 4, 3) on their triangles; normal maps bend no further."""
    if not len(spots.scene.normals):
        return np.zeros_like(moves)
    first, second = spots.edges[:, :1], spots.edges[:, 1:]
    square = dot(first, first), dot(first, second), dot(second, second)
    area = square[0] * square[2] - square[1] ** 2
    onto = dot(moves, first), dot(moves, second)
    b = (square[2] * onto[0] - square[1] * onto[1]) / area
    c = (square[0] * onto[1] - square[1] * onto[0]) / area
    corners = spots.scene.normals[spots.triangle].astype(np.float64)
    change = b * (corners[:, 1:2] - corners[:, :1]) + c * (corners[:, 2:] - corners[:, :1])
    mean = (spots.weights[..., None] * corners).sum(1, keepdims=True)
    length = np.linalg.norm(mean, axis=2, keepdims=True)
    side = np.sign(dot(mean, normal[:, None]))
    return side * (change - dot(change, mean) * mean / length**2) / length


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Products over the last axis, which stays."""
    return (a * b).sum(-1, keepdims=True)
