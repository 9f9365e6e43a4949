"""Cases 7, 9, 10, 11 and 15: needles, grazing rays, axes, flat boxes, coplanar triangles.

Units of the errors as in ``extents``: a share of the rays (bound 0), or ulp of depth over the
condition number (bound 16).
"""

from __future__ import annotations

import functools
from collections.abc import Iterator

import numpy as np

from lfcore.evaluation.stability import naive
from lfcore.evaluation.stability.judge import (
    choice_and_depth,
    leaks,
    row,
    truth,
)
from lfcore.evaluation.stability.rows import Row
from lfcore.evaluation.stability.shapes import grid, rays_at
from lfcore.evaluation.stability.subject import Subject


def needles(subject: Subject) -> Iterator[Row]:
    """Triangles 1 m long and 1 / aspect wide in any direction, rays at points within."""
    rng = np.random.default_rng(7)
    for aspect in 10.0 ** np.arange(0, 9):
        along = rng.normal(0, 1, (300, 3))
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        aside = np.cross(along, rng.normal(0, 1, (300, 3)))
        aside /= np.linalg.norm(aside, axis=1, keepdims=True) * aspect
        p = rng.uniform(-1, 1, (300, 3)) + [0, 0, 4]
        mesh = np.float32(np.stack([p, p + along, p + aside], 1))
        rays = rays_at(mesh.mean(1, dtype=float), (0.01, -0.02))
        yield from _shares(subject, "needles", "aspect", aspect, mesh, rays)


def grazing(subject: Subject) -> Iterator[Row]:
    """A plane through the axis at 3 m, tilted against the rays by theta."""
    rng = np.random.default_rng(9)
    for theta in 10.0 ** -np.arange(1, 8):
        slope = np.array([0.0, np.tan(theta), 1.0])
        mesh = np.float32(grid(4, 4, [-1, -theta, 2], [2, 0, 0], 2 * slope))
        u, v = rng.uniform(0.1, 0.9, (2, 1000, 1))
        points = np.array([-1, -theta, 2.0]) + 2 * u * [1, 0, 0] + 2 * v * slope
        rays = rays_at(points, (0.0, 0.0))
        rays[1][:, 1] = 0  # along the axis in y: the plane is met at theta
        rays[0][:, 1] = np.float32(points[:, 1])
        yield from _shares(subject, "grazing", "theta rad", theta, mesh, rays)


def _shares(subject, case, parameter, value, mesh, rays) -> Iterator[Row]:
    hits = truth(mesh, *rays)
    plain = naive.moeller_trumbore(mesh, *rays)
    found = functools.partial(subject.closest, mesh, *rays)
    yield from choice_and_depth(case, parameter, value, hits, plain, found)


def axes(subject: Subject) -> Iterator[Row]:
    """Rays with directions of 0, -0 and +-1 whose origins lie on the faces of a cube's box."""
    mesh = np.float32(_cube() + [0, 0, 3])
    for on_face in (0, 1):
        slopes = np.float32([-1, -0.0, 0.0, 1]) * np.float32(0.25)
        starts = np.float32([-1, 0, 1] if on_face else [-0.7, 0.1, 0.6])
        x, y, dx, dy = (a.ravel() for a in np.meshgrid(starts, starts, slopes, slopes))
        zeros = np.zeros_like(x)
        rays = np.stack([x, y, zeros], 1), np.stack([dx, dy, zeros + 1], 1)
        hits = truth(mesh, *rays)

        def box(rays=rays, hits=hits):
            lo, hi = mesh.min((0, 1)), mesh.max((0, 1))
            return ((hits.triangle >= 0) & ~naive.slab_test(lo, hi, *rays)).mean()

        yield row(
            "axis directions",
            "origin on face",
            on_face,
            0.0,
            box,
            lambda rays=rays, hits=hits: leaks(subject.closest(mesh, *rays), hits),
        )


def any_axes(subject: Subject) -> Iterator[Row]:
    """All 26 directions of 0, -0 and +-1 from within a cube far off, on its inner planes."""
    steps = np.float32([-1, -0.0, 0.0, 1])
    directions = np.stack(np.meshgrid(steps, steps, steps), -1).reshape(-1, 3)
    directions = directions[directions.any(1)]
    for distance in (0.0, 1e2, 1e4, 1e6):
        centre = np.float32([distance, -distance, 0.5 * distance])
        mesh = np.float32(_cube() + centre.astype(float))
        starts = np.float32([[0, 0, 0], [0.5, 0, -0.5], [0.25, 0.25, 0.5]]) + centre
        rays = np.repeat(starts, len(directions), 0), np.tile(directions, (len(starts), 1))
        hits = truth(mesh, *rays)
        yield row(
            "axis directions, any",
            "|c| m",
            distance,
            0.0,
            lambda mesh=mesh, rays=rays, hits=hits: leaks(
                naive.moeller_trumbore(mesh, *rays), hits
            ),
            lambda mesh=mesh, rays=rays, hits=hits: leaks(subject.any_closest(mesh, *rays), hits),
        )


def _cube() -> np.ndarray:
    """The cube of side 2 about the origin, 8 triangles a face."""
    faces = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            corner, across, down = -np.ones(3), np.zeros(3), np.zeros(3)
            corner[axis], across[axis - 1], down[axis - 2] = side, 2.0, 2.0
            faces.append(grid(2, 2, corner, across, down))
    return np.concatenate(faces)


def flat_boxes(subject: Subject) -> Iterator[Row]:
    """Rays at the corners of lone triangles whose boxes have 0, 1 or 2 flat dimensions.

    One triangle is one leaf box; the ray to its corner must not be lost by the box test.
    """
    rng = np.random.default_rng(11)
    for flat in (0, 1, 2):
        lost, plain = [], []
        for _ in range(12):
            triangle = np.float32(rng.uniform(-1, 1, (1, 3, 3)) + [0, 0, 3])
            if flat >= 1:
                triangle[..., 2] = triangle[0, 0, 2]
            if flat == 2:  # as flat as an area allows
                triangle[..., 1] = triangle[0, 0, 1] + np.float32([0, 1e-6, 2e-6])
            corners = np.repeat(triangle[0].astype(float), 100, axis=0)
            rays = rays_at(corners, rng.uniform(-0.3, 0.3, (300, 2)))
            hits = truth(triangle, *rays)
            lo, hi = triangle.min((0, 1)), triangle.max((0, 1))
            plain.append(((hits.triangle >= 0) & ~naive.slab_test(lo, hi, *rays)).mean())
            lost.append(_clear_leaks(subject.closest(triangle, *rays), hits))
        yield row(
            "flat boxes",
            "flat dimensions",
            flat,
            0.0,
            lambda plain=plain: np.mean(plain),
            lambda lost=lost: np.max(lost),
        )


def _clear_leaks(found, hits) -> float:
    """Misses outside 16 ulp of the free edges: a ray at a lone corner may go either way."""
    return float(((found[0] < 0) & (hits.triangle >= 0) & hits.clear()).mean())


def coplanar(subject: Subject) -> Iterator[Row]:
    """Copies of one triangle, in an order of its own each: the lowest number must win.

    Naive: the first in the order that a tree happens to visit, here the last.
    """
    rng = np.random.default_rng(15)
    points = rng.uniform(0.05, 0.3, (500, 2))
    rays = rays_at(np.concatenate([points, np.full((500, 1), 2.0)], 1), (0.01, 0.0))
    for copies in (2, 16, 17, 256, 1024):
        mesh = np.tile(np.float32([[[0, 0, 2], [1, 0, 2], [0, 1, 2]]]), (copies, 1, 1))
        yield row(
            "coplanar copies",
            "copies",
            copies,
            0.0,
            lambda mesh=mesh: (
                len(mesh) - 1 - naive.moeller_trumbore(mesh[::-1], *rays)[0] != 0
            ).mean(),
            lambda mesh=mesh: (subject.closest(mesh, *rays)[0] != 0).mean(),
        )


def nearly_coplanar(subject: Subject) -> Iterator[Row]:
    """Two triangles that part by some ulp of their depth: the nearer must win from 16 on.

    Error: share of the rays that name the other one, of those that the bound on depth, 16 ulp over
    the condition number, leaves no choice; below that, of rays whose answer is neither.
    """
    points = np.random.default_rng(16).uniform(0.05, 0.3, (500, 2))
    rays = rays_at(np.concatenate([points, np.full((500, 1), 2.0)], 1), (0.01, 0.0))
    for ulp in (0, 1, 2, 4, 8, 16, 32, 64):
        depth = np.float32(2 + ulp * 2.0**-22)  # an ulp is 2^-23 of numbers from 1 to 2
        back = np.float32([[0, 0, depth], [1, 0, depth], [0, 1, depth]])
        mesh = np.stack([back, np.float32([[0, 0, 2], [1, 0, 2], [0, 1, 2]])])
        hits = truth(mesh, *rays)

        def wrong(found, hits=hits):
            ids = np.asarray(found[0])
            return ((ids != hits.triangle) & (hits.clear() | (ids < 0))).mean()

        yield row(
            "nearly coplanar",
            "separation ulp",
            ulp,
            0.0,
            lambda mesh=mesh: wrong(naive.moeller_trumbore(mesh, *rays)),
            lambda mesh=mesh: wrong(subject.closest(mesh, *rays)),
            condition=np.inf if ulp == 0 else 2.0**23 / ulp,
        )


def no_area(subject: Subject) -> Iterator[Row]:
    """Points, repeated corners and collinear ones among sound triangles, rays aimed at them.

    Error: share of the rays that name one of them or whose answer they change.
    """
    rng = np.random.default_rng(17)
    base = np.float32(rng.uniform(-1, 1, (200, 1, 3)) + [0, 0, 3] + rng.normal(0, 0.1, (200, 3, 3)))
    for share in (0.1, 0.5, 0.9):
        count = round(200 * share / (1 - share))
        # Multiples of 2^-12, so that collinear corners are exactly so.
        flat = np.round(base[rng.integers(0, 200, count)] * 4096) / 4096
        flat[0::3, 1:] = flat[0::3, :1]
        flat[1::3, 2] = flat[1::3, 1]
        flat[2::3, 2] = 2 * flat[2::3, 1] - flat[2::3, 0]
        mesh = np.concatenate([base, flat])
        targets = flat.mean(1, dtype=float)
        rays = rays_at(targets, (0.01, -0.01))
        hits = truth(base, *rays)

        def wrong(found, hits=hits):
            ids, t = (np.asarray(part) for part in found)
            bad = (ids >= 200) | ((ids != hits.triangle) & hits.clear())
            return (bad | np.isnan(t)).mean()

        yield row(
            "no area",
            "share",
            share,
            0.0,
            lambda mesh=mesh, rays=rays: wrong(naive.moeller_trumbore(mesh, *rays)),
            lambda mesh=mesh, rays=rays: wrong(subject.closest(mesh, *rays)),
        )


CASES = (needles, no_area, nearly_coplanar, grazing, axes, any_axes, flat_boxes, coplanar)
