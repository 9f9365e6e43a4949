"""Cases 3, 4, 8, 12, 13 and 16: where a scene is and how large.

Error, unless a case says otherwise: share of rays that name another triangle than the oracle
outside 16 ulp of an edge or tie (bound 0), or the error of the depth in ulp over the condition
number (bound 16).
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import yaml

from lfcore.evaluation.stability import naive
from lfcore.evaluation.stability.judge import (
    choice_and_depth,
    condition_of_depth,
    depth_error,
    mismatches,
    row,
    truth,
)
from lfcore.evaluation.stability.rows import NO_ANSWER, Row
from lfcore.evaluation.stability.shapes import grid, random_rays, rays_at, soup, sphere
from lfcore.evaluation.stability.subject import Subject, check_kept
from lfcore.scene.build import build_scene

ALL_DIGITS = 2.0**24
"""The error, in units of 2^-24 of a depth, that is as large as the depth itself."""


def far_from_the_origin(subject: Subject) -> Iterator[Row]:
    """Scene and camera moved by |c| together; error of depth in units of 2^-24 of it.

    Ours is read from a scene file with a mesh and a camera in world coordinates, as every scene
    is; the naive method rounds world coordinates.
    """
    local = soup(600, 0.1)
    origins, directions = random_rays(subject.rays, 0.4)
    hits = truth(local, origins, directions)
    for distance in (0.0, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7):
        centre = np.array([0.6, 0.64, 0.48]) * distance
        world = local * [1, -1, -1] + centre  # y is up, and the camera looks along -z

        def plain(world=world, centre=centre):
            rays = np.float32(origins + centre), np.float32(directions * [1, -1, -1])
            return _or_lost(naive.moeller_trumbore(np.float32(world), *rays), hits)

        def ours(world=world, centre=centre):
            mesh = _from_file(world, centre)
            return _or_lost(subject.closest(mesh, origins, directions), hits)

        # World coordinates in float64 are themselves rounded, by 2^-53 of |c|.
        bound = 16 + distance * 2.0**-26
        kappa = max(1.0, distance) * condition_of_depth(hits)
        yield row("far from the origin", "|c| m", distance, bound, plain, ours, condition=kappa)


def _from_file(world: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """(T, 3, 3) float32 of a mesh file in world coordinates, as its scene is read from disk."""
    with tempfile.TemporaryDirectory() as folder:
        lines = ["v {!r} {!r} {!r}".format(*corner) for corner in world.reshape(-1, 3).tolist()]
        lines += [f"f {k} {k + 1} {k + 2}" for k in range(1, 3 * len(world), 3)]
        Path(folder, "mesh.obj").write_text("\n".join(lines) + "\n", encoding="ascii")
        pose = {"position_m": centre.tolist(), "look_at_m": (centre - [0, 0, 1]).tolist()}
        camera = {"focal_length_mm": 50, "sensor_width_mm": 36, "focus_distance_m": 2}
        scene = {"camera": camera | {"pose": pose}, "objects": [{"file": "mesh.obj"}]}
        file = Path(folder, "scene.yaml")
        file.write_text(yaml.safe_dump(scene), encoding="utf-8")
        return build_scene(file).triangles


def _or_lost(found, hits) -> float:
    """The depth error; all digits are lost when more than 1% of the hits differ."""
    return ALL_DIGITS if mismatches(found, hits) > 0.01 else depth_error(found, hits)


def long_rays(subject: Subject) -> Iterator[Row]:
    """An object of 1 m at depth L.  The parameter is depth, so the bound is relative to L."""
    for length in 10.0 ** np.arange(0, 8):
        mesh = np.float32(soup(300, 0.1, depth=0.0) * 0.2 + [0, 0, length])
        points = mesh.mean(1, dtype=float)
        rays = rays_at(points, (0.01, -0.01))
        yield from _two_rows(subject, "long rays", "L / size", length, mesh, rays)


def tiny_triangles(subject: Subject) -> Iterator[Row]:
    """A tilted wall at 1 m in triangles of ever smaller side, rays at their centres.

    Naive: with the customary cut-off at a determinant of 1e-6.
    """
    for size in 10.0 ** -np.arange(0, 9):
        half, side = -6 * size, 12 * size
        mesh = np.float32(grid(12, 12, [half, half, 1.0], [side, 0, side], [0, side, 0]))
        rays = rays_at(mesh.mean(1, dtype=float), (0.01, -0.01))
        yield from _two_rows(subject, "tiny triangles", "side / distance", size, mesh, rays, 1e-6)


def large_triangles(subject: Subject) -> Iterator[Row]:
    """Triangles with two corners about 1 m away, the third ``reach`` times as far, any direction.

    Beyond ``reach`` = 100 a share of the rays that grows to all of them is wrong today.
    """
    for reach in (1.0, 3.0, 10.0, 30.0, 100.0):
        rng = np.random.default_rng(8)
        mesh = rng.uniform(-0.5, 0.5, (50, 3, 3)) + [0, 0, 1.5]
        away = rng.normal(0, 1, (50, 3))
        mesh[:, 2] += reach * away / np.linalg.norm(away, axis=1, keepdims=True)
        rays = random_rays(subject.rays, 0.4)
        yield from _two_rows(
            subject, "large triangles", "reach / depth", reach, np.float32(mesh), rays
        )


def scaled_scene(subject: Subject) -> Iterator[Row]:
    """Scene and lens scaled so that the largest coordinate is ``scale`` metres.

    The float32 range ends at 1e38 and 1e-38, and the product of three lengths, which is how depth
    is made, at their third root.
    """
    origins, directions = random_rays(subject.rays, 0.4)
    base = soup(600, 0.1)
    size = np.abs(base).max()
    base, origins = base / size, origins / size
    for exponent in (20, 15, 13, 12, 9, 6, 3, -3, -6, -9, -10, -12, -15, -20, -30, -40):
        scale = 10.0**exponent
        mesh, origin = np.float32(base * scale), np.float32(origins * scale)
        limit = "coordinates" if exponent > 12 else "small triangles" if exponent < -10 else ""
        rays = origin, directions
        yield from _two_rows(subject, "scaled scene", "scale", scale, mesh, rays, limit=limit)


def far_sphere(subject: Subject) -> Iterator[Row]:
    """A sphere of 1 m at distance D; naive: the quadratic formula, error over 2^-24 D."""
    for distance in (1e1, 1e2, 1e3, 1e4, 1e5):
        centre = (0.0, 0.0, distance)
        mesh = np.float32(sphere(12, 24, 1.0, centre))
        targets = np.random.default_rng(1).uniform(-0.6, 0.6, (subject.rays // 5, 2))
        points = np.concatenate([targets, np.full((subject.rays // 5, 1), distance)], 1)
        rays = rays_at(points, (0.0, 0.0))
        hits = truth(mesh, *rays)

        def plain(rays=rays, centre=centre, distance=distance):
            d = rays[1].astype(float)
            a, b, c = (d**2).sum(1), -2 * d[:, 2] * distance, distance**2 - 1.0
            # -b is positive: the stable root, c over the half sum, is the near one.
            exact = 2 * c / (-b + np.sqrt(b * b - 4 * a * c))
            error = np.abs(naive.sphere(centre, 1.0, *rays) - exact) / distance * 2**24
            return np.nan_to_num(error, nan=NO_ANSWER).max()

        def ours(mesh=mesh, rays=rays, hits=hits):
            return depth_error(subject.closest(mesh, *rays), hits)

        kappa = distance * condition_of_depth(hits)
        yield row("far sphere", "D / r", distance, 16, plain, ours, condition=kappa)


def _two_rows(
    subject, case, parameter, value, mesh, rays, epsilon=0.0, *, limit=""
) -> Iterator[Row]:
    """Triangle and depth; ``limit`` is the one beyond which the mesh lies."""
    hits = truth(mesh, *rays)
    plain = naive.moeller_trumbore(mesh, *rays, epsilon=epsilon)

    def found():
        check_kept(mesh)
        return subject.closest(mesh, *rays)

    yield from choice_and_depth(case, parameter, value, hits, plain, found, limit=limit)


CASES = (
    far_from_the_origin,
    long_rays,
    tiny_triangles,
    large_triangles,
    scaled_scene,
    far_sphere,
)
