"""Cases 3, 4, 8, 12, 13, 16 and 18: place and size of a scene, by single rays and by blocks.

Error, by default: share of rays that name another triangle than the oracle
outside 16 ulp of an edge or tie (bound 0), or the error of the depth in ulp over the condition
number (bound 16).
"""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import yaml

from lfcore.evaluation.stability import naive, shapes
from lfcore.evaluation.stability.measurement import (
    DEPTH,
    NO_ANSWER,
    Bound,
    Measurement,
    choice_and_depth,
    condition_of_depth,
    depth_error,
    measured,
    mismatches,
    oracle_hits,
    sweep,
)
from lfcore.evaluation.stability.shapes import single
from lfcore.evaluation.stability.tested_tracer import CAMERA, Found, TracerUnderTest
from lfcore.optics.bundles import macropixels
from lfcore.optics.slab import Slab
from lfcore.oracle.intersect import Hits
from lfcore.scene.build import build_scene

ALL_DIGITS = 2.0**24
"""The error, in units of 2^-24 of a depth, that is as large as the depth itself."""
BLOCK_PIXELS = 24


@sweep("3", "|c| m", (0.0, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7))
def far_from_the_origin(tracer: TracerUnderTest, distance: float) -> Measurement:
    """Scene and camera moved by |c| together; error of depth in units of 2^-24 of it.

    Ours is read from a scene file with a mesh and a camera in world coordinates, as every scene
    is; the naive method rounds world coordinates.
    """
    local = shapes.soup(600)
    origins, directions = shapes.random_rays(tracer.rays)
    hits = oracle_hits(local, (origins, directions))
    centre = np.array([0.6, 0.64, 0.48]) * distance
    world = local * [1, -1, -1] + centre  # y is up, and the camera looks along -z

    def by_naive() -> float:
        rays = single(origins + centre), single(directions * [1, -1, -1])
        return _or_lost(naive.moeller_trumbore(single(world), *rays), hits)

    def ours() -> float:
        mesh = _from_file(world, centre)
        return _or_lost(tracer.closest(mesh, origins, directions), hits)

    # World coordinates in float64 are themselves rounded, by 2^-53 of |c|.
    reason = DEPTH.reason + "; world coordinates are float64"
    bound = Bound(DEPTH.error + distance * 2.0**-26, DEPTH.unit, reason)
    kappa = max(1.0, distance) * condition_of_depth(hits)
    return measured("far from the origin", bound, by_naive, ours, condition=kappa)


def _from_file(world: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """(T, 3, 3) float32 of a mesh file in world coordinates, as its scene is read from disk."""
    with tempfile.TemporaryDirectory() as folder:
        lines = ["v {!r} {!r} {!r}".format(*corner) for corner in world.reshape(-1, 3).tolist()]
        lines += [f"f {k} {k + 1} {k + 2}" for k in range(1, 3 * len(world), 3)]
        Path(folder, "mesh.obj").write_text("\n".join(lines) + "\n", encoding="ascii")
        pose = {"position_m": centre.tolist(), "look_at_m": (centre - [0, 0, 1]).tolist()}
        camera = {"focal_length_mm": 50, "sensor_width_mm": 36, "focus_m": 2}
        scene = {"camera": camera | {"pose": pose}, "objects": [{"file": "mesh.obj"}]}
        file = Path(folder, "scene.yaml")
        file.write_text(yaml.safe_dump(scene), encoding="utf-8")
        return build_scene(file).triangles


def _or_lost(found: Found, hits: Hits) -> float:
    """The depth error; all digits are lost when more than 1% of the hits differ."""
    return ALL_DIGITS if mismatches(found, hits) > 0.01 else depth_error(found, hits)


@sweep("4", "L / size", 10.0 ** np.arange(0, 8))
def long_rays(tracer: TracerUnderTest, length: float) -> Iterator[Measurement]:
    """An object of 1 m at depth L.  The parameter is depth, so the bound is relative to L."""
    mesh = single(shapes.soup(300, depth=0.0) * 0.2 + [0, 0, length])
    rays = shapes.rays_at(mesh.mean(1, dtype=float), (0.01, -0.01))
    return choice_and_depth("long rays", tracer.closest, mesh, rays)


@sweep("8", "side / distance", 10.0 ** -np.arange(0, 9))
def tiny_triangles(tracer: TracerUnderTest, size: float) -> Iterator[Measurement]:
    """A tilted wall at 1 m in triangles of ever smaller side, rays at their centres.

    Naive: with the customary cut-off at a determinant of 1e-6.
    """
    half, side = -6 * size, 12 * size
    mesh = single(shapes.grid(12, 12, [half, half, 1.0], [side, 0, side], [0, side, 0]))
    rays = shapes.rays_at(mesh.mean(1, dtype=float), (0.01, -0.01))
    return choice_and_depth("tiny triangles", tracer.closest, mesh, rays, epsilon=1e-6)


@sweep("8", "reach / depth", (1.0, 3.0, 10.0, 30.0, 100.0))
def large_triangles(tracer: TracerUnderTest, reach: float) -> Iterator[Measurement]:
    """Triangles with two corners about 1 m away, the third ``reach`` times as far, any direction.

    Beyond ``reach`` = 100 more and more rays are wrong, finally all.
    """
    rng = np.random.default_rng(8)
    mesh = rng.uniform(-0.5, 0.5, (50, 3, 3)) + [0, 0, 1.5]
    away = rng.normal(0, 1, (50, 3))
    mesh[:, 2] += reach * away / np.linalg.norm(away, axis=1, keepdims=True)
    rays = shapes.random_rays(tracer.rays)
    return choice_and_depth("large triangles", tracer.closest, single(mesh), rays)


SCALES = (20, 15, 13, 12, 9, 6, 3, -3, -6, -9, -10, -12, -15, -20, -30, -40)


@sweep("12, 13", "scale", [10.0**exponent for exponent in SCALES])
def scaled_scene(tracer: TracerUnderTest, scale: float) -> Iterator[Measurement]:
    """Scene and lens scaled so that the largest coordinate is ``scale`` metres.

    The float32 range ends at 1e38 and 1e-38, and the product of three lengths, which is how depth
    is made, at their third root.
    """
    origins, directions = shapes.random_rays(tracer.rays)
    base = shapes.soup(600)
    size = np.abs(base).max()
    base, origins = base / size, origins / size
    limit = "coordinates" if scale > 1e12 else "small triangles" if scale < 1e-10 else ""
    rays = single(origins * scale), directions
    return choice_and_depth("scaled scene", tracer.closest, single(base * scale), rays, limit=limit)


@sweep("16", "D / r", (1e1, 1e2, 1e3, 1e4, 1e5))
def far_sphere(tracer: TracerUnderTest, distance: float) -> Measurement:
    """A sphere of 1 m at distance D; naive: the quadratic formula, error over 2^-24 D."""
    centre = (0.0, 0.0, distance)
    mesh = single(shapes.sphere(12, 24, 1.0, centre))
    targets = np.random.default_rng(1).uniform(-0.6, 0.6, (tracer.rays // 5, 2))
    rays = shapes.rays_at(shapes.at_depth(targets, distance), (0.0, 0.0))
    hits = oracle_hits(mesh, rays)

    def by_naive() -> float:
        d = rays[1].astype(float)
        a, b, c = (d**2).sum(1), -2 * d[:, 2] * distance, distance**2 - 1.0
        # -b is positive: the stable root, c over the half sum, is the near one.
        exact = 2 * c / (-b + np.sqrt(b * b - 4 * a * c))
        error = np.abs(naive.sphere(centre, 1.0, *rays) - exact) / distance * 2**24
        return np.nan_to_num(error, nan=NO_ANSWER).max()

    return measured(
        "far sphere",
        DEPTH,
        by_naive,
        lambda: depth_error(tracer.closest(mesh, *rays), hits),
        condition=distance * condition_of_depth(hits),
    )


@sweep("8", "m", (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7))
def triangle_sizes(tracer: TracerUnderTest, size: float) -> Iterator[Measurement]:
    """Triangles of ever smaller size at 1 to 3 m, each met by rays of some pixel; N = 16."""
    return _blocks("blocks: triangle size", tracer, Slab(CAMERA, 16, 64), size)


@sweep("18", "N", (1, 2, 5, 16, 40))
def lens_samples(tracer: TracerUnderTest, views: int) -> Iterator[Measurement]:
    """Triangles of 1 cm, from one lens sample (in a corner of its block) to many."""
    return _blocks("blocks: lens samples", tracer, Slab(CAMERA, views, 64), 1e-2)


def _blocks(case: str, tracer: TracerUnderTest, slab: Slab, size: float) -> Iterator[Measurement]:
    """Blocks of a slab's rays at once: an arithmetic that the lone rays of others do not use.

    A triangle is set up once for 16 x 16 rays, relative to their middle ray; the errors must be
    those of the triangle all the same, and not of the block.
    """
    rng = np.random.default_rng(21)
    pixels = np.unique(rng.integers(0, slab.pixels, (BLOCK_PIXELS, 2)), axis=0)
    rays = shapes.one_by_one(macropixels(slab, pixels).rays())
    aimed = rng.integers(0, len(rays[0]), 600)
    centres = rays[0][aimed] + rng.uniform(1, 3, (600, 1)) * rays[1][aimed]
    mesh = single(centres[:, None] + rng.normal(0, size, (600, 3, 3)))
    return choice_and_depth(case, lambda *_: tracer.slab_hits(mesh, slab, pixels), mesh, rays)
