"""Emitting surfaces as point lights: the points' positions and intensities.

A surface of radiance L with normals n illuminates a receiver with normal n'.  With x the vector
from the receiver to a point of the surface, and w its direction, the irradiance is

    E = L  integral of  max(-n . w, 0) max(n' . w, 0) / |x|^2  dA

It is summed over a few points weighted by area, each with its cosine ``-n . w``.

A whole sphere needs no cosines.  A receiver that sees all of it has the irradiance of a point of
intensity L pi r^2 in its centre, and the same irradiance from any spherical shell about the centre
(Newton's theorem: the field is harmonic).  Twelve points on the corners of an icosahedron equal a
shell up to terms of order 6 in the shell's radius over the distance (a spherical 5-design:
Delsarte, Goethals and Seidel, "Spherical codes and designs", 1977).  The shell's radius is
sqrt(3/4) r: then the points have the second moments of the sphere's disk, and the same penumbra.
"""

import math
from typing import NamedTuple

import numpy as np

from lfcore.scene.surface_mesh import area_vectors

POINTS = 12
"""The default number of points per emitter."""
OFFSET = 1e-4
"""The distance of points from a flat emitter, as a share of its size: the emitter would occlude
points on itself."""
SAMPLES_PER_POINT = 128
"""The samples of the surface per point."""
_ROUNDS = 30
"""The rounds of Lloyd's algorithm."""
_ROUND = 1e-3
"""The greatest distance of a sphere's corners from the fitted sphere, in its radii."""
_AREA_LOST = 0.03
"""The greatest share of a sphere's area that is lost by its chords."""
_FLAT = 1e-6
"""The tolerance of sums of area vectors: 0 for a closed surface, the area for a flat one."""
_SHELL = math.sqrt(0.75)
"""The radius of a sphere's shell of points, in its radii."""


class EmitterPoints(NamedTuple):
    """Point lights for an emitter.

    Attributes
    ----------
    positions : ndarray
        (P, 3) metres.
    normals : ndarray
        (P, 3) unit normals; zero: equal light in all directions.
    areas : ndarray
        (P,) square metres.  A point's intensity is radiance times area, and times the cosine to
        the normal if there is one.
    """

    positions: np.ndarray
    normals: np.ndarray
    areas: np.ndarray


def emitter_points(
    triangles: np.ndarray, count: int = POINTS, *, two_sided: bool = False
) -> EmitterPoints | None:
    """Represent an emitter, (T, 3, 3) with counter-clockwise fronts, by point lights.

    None for a surface without area.  With 12 points, irradiance has an error of at most 2% from a
    distance of one diameter from a disk, one side from a square and half a diameter from a sphere,
    if the receiver sees all of it.  Other surfaces have errors up to 20%; with 48 points, 5%.
    """
    triangles = np.asarray(triangles, np.float64)
    double = area_vectors(triangles)
    length = np.linalg.norm(double, axis=1)
    if not length.sum() > 0:
        return None
    sphere = None if two_sided else _as_sphere(triangles, double, length)
    if sphere is not None:
        corners = _design(count)
        middle, radius = sphere
        areas = np.full(len(corners), math.pi * radius**2 / len(corners))
        return EmitterPoints(middle + _SHELL * radius * corners, np.zeros_like(corners), areas)
    front = _spread(triangles, double, length, count)
    if not two_sided:
        return front
    back = _spread(triangles[:, [0, 2, 1]], -double, length, count)
    return EmitterPoints(*(np.concatenate(both) for both in zip(front, back, strict=True)))


def _as_sphere(
    triangles: np.ndarray, double: np.ndarray, length: np.ndarray
) -> tuple[np.ndarray, float] | None:
    """Middle and radius of a closed sphere that emits outward; None for other surfaces."""
    if np.linalg.norm(double.sum(0)) > _FLAT * length.sum():
        return None
    corners = triangles.reshape(-1, 3)
    shift = corners.mean(0)
    around = corners - shift
    # |p|^2 = 2 c . p + r^2 - |c|^2 for every corner p.
    matrix = np.concatenate([2 * around, np.ones((len(around), 1))], axis=1)
    solved, _, rank, _ = np.linalg.lstsq(matrix, (around**2).sum(1), rcond=None)
    if rank < 4:
        return None
    middle = solved[:3]
    radius = math.sqrt(max(solved[3] + middle @ middle, 0.0))
    off = np.abs(np.linalg.norm(around - middle, axis=1) - radius).max()
    lost = 1 - length.sum() / 2 / (4 * math.pi * radius**2)
    outward = (double * (triangles.mean(1) - shift - middle)).sum()
    if off > _ROUND * radius or not -1e-6 < lost < _AREA_LOST or outward <= 0:
        return None
    return middle + shift, radius


def _design(count: int) -> np.ndarray:
    """(P, 3) unit: corners of the largest regular solid of at most ``count`` corners; 0 for one."""
    if count >= 12:
        golden = (1 + math.sqrt(5)) / 2
        plane = np.array([[0, y, z] for y in (1, -1) for z in (golden, -golden)])
        corners = np.concatenate([np.roll(plane, turn, axis=1) for turn in range(3)])
        return corners / math.hypot(1, golden)
    if count >= 6:
        return np.concatenate([np.eye(3), -np.eye(3)])
    if count >= 4:
        return np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / math.sqrt(3)
    return np.zeros((1, 3))


def _spread(
    triangles: np.ndarray, double: np.ndarray, length: np.ndarray, count: int
) -> EmitterPoints:
    """Points of patches of similar area, position and direction, by Lloyd's algorithm."""
    from scipy.spatial import cKDTree  # slow to import, and few scenes have emitters

    total = length.sum() / 2
    positions, faces = _samples(triangles, length, count * SAMPLES_PER_POINT)
    normals = double[faces] / length[faces][:, None]
    size = float(np.linalg.norm(np.ptp(positions, axis=0)))
    places = np.concatenate([positions / size, normals / 2], axis=1)
    middles = places[_far_apart(places, count)]
    for _ in range(_ROUNDS):
        nearest = cKDTree(middles).query(places)[1]
        shares = np.bincount(nearest, minlength=len(middles))
        sums = np.stack([np.bincount(nearest, axis, len(middles)) for axis in places.T], axis=1)
        middles = sums / shares[:, None]
    nearest = cKDTree(middles).query(places)[1]
    weights = np.bincount(nearest, minlength=len(middles)) / len(places)
    # Each patch takes the sample nearest its mean: the mean itself may be off the surface.
    chosen = cKDTree(places).query(middles)[1]
    points, normals = positions[chosen], normals[chosen]
    if np.linalg.norm(double.sum(0)) > (1 - _FLAT) * length.sum():
        weights = _balanced(points, weights, positions)
    return EmitterPoints(points + OFFSET * size * normals, normals, weights * total)


def _samples(
    triangles: np.ndarray, length: np.ndarray, number: int
) -> tuple[np.ndarray, np.ndarray]:
    """(number, 3) points spread evenly over the area, and their triangles (number,)."""
    cumulative = np.cumsum(length) / length.sum()
    shares = (np.arange(number) + 0.5) / number
    faces = np.minimum(np.searchsorted(cumulative, shares), len(triangles) - 1)
    # The additive recurrence R2 of M. Roberts, "The unreasonable effectiveness of quasirandom
    # sequences", 2018.
    plastic = 1.32471795724474602596
    a, b = ((0.5 + np.arange(number) / plastic**power) % 1 for power in (1, 2))
    root = np.sqrt(a)
    weights = np.stack([1 - root, root * (1 - b), root * b], axis=-1)
    return (weights[:, :, None] * triangles[faces]).sum(1), faces


def _far_apart(places: np.ndarray, count: int) -> list[int]:
    """Choose places, each the farthest from those before; fewer than ``count`` if others are
    equal."""
    chosen = [0]
    distance = ((places - places[0]) ** 2).sum(1)
    while len(chosen) < count and distance.max() > 0:
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, ((places - places[chosen[-1]]) ** 2).sum(1))
    return chosen


def _balanced(points: np.ndarray, weights: np.ndarray, positions: np.ndarray) -> np.ndarray:
    """Weights of a flat surface's points, changed least, so that moments up to the second agree."""
    middle = positions.mean(0)
    axes = np.linalg.svd(positions - middle, full_matrices=False)[2][:2]
    size = np.abs(positions - middle).max()

    def moments(at: np.ndarray) -> np.ndarray:
        x, y = axes @ (at - middle).T / size
        return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y])

    rows, target = moments(points), moments(positions).mean(1)
    if np.linalg.matrix_rank(rows) < len(rows):
        return weights
    change = np.linalg.lstsq((rows * weights) @ rows.T, target - rows @ weights, rcond=None)[0]
    balanced = weights + weights * (rows.T @ change)
    return balanced if (balanced > 0).all() else weights
