"""Cases 1 and 2: rays aimed at the edges and vertices of closed meshes.

Error: share of the rays that leak; bound: none may.
"""

from __future__ import annotations

import functools

import numpy as np

from lfcore.evaluation.stability.hit_errors import compared, leaks, oracle_hits
from lfcore.evaluation.stability.measurement import Bound, Measurement, measured, sweep
from lfcore.evaluation.stability.naive import moeller_trumbore
from lfcore.evaluation.stability.shapes import Rays, grid, one_by_one, rays_at, single, sphere
from lfcore.evaluation.stability.tested_tracer import CAMERA, ClosestHit, TracerUnderTest
from lfcore.optics.slab import Slab
from lfcore.oracle.slab import slab_rays

LEAKING = "share of rays that leak"


@sweep("1", "columns", (12, 50, 100))
def edge_rays(tracer: TracerUnderTest, columns: int) -> Measurement:
    """Points of edges of a sphere seen from within, ever finer."""
    mesh = single(sphere(max(6, columns // 4), columns, 2.0))
    rng = np.random.default_rng(columns)
    ahead = mesh[(mesh[:, :, 2] > 0.3).all(1)].astype(float)
    chosen = rng.integers(0, len(ahead), tracer.rays)
    side, share = rng.integers(0, 3, tracer.rays), rng.uniform(0, 1, (tracer.rays, 1))
    points = ahead[chosen, side] * share + ahead[chosen, (side + 1) % 3] * (1 - share)
    rays = rays_at(points, rng.uniform(-0.1, 0.1, (tracer.rays, 2)))
    return _leaks("edge rays", tracer.closest, mesh, rays)


@sweep("2", "valence", (4, 8, 64, 200))
def vertex_rays(tracer: TracerUnderTest, valence: int) -> Measurement:
    """The pole of a sphere seen from within, of ever more triangles."""
    mesh = single(sphere(8, valence, 2.0))
    count = max(50, 2 * tracer.rays // valence)  # the oracle settles each of these by integers
    lens = np.random.default_rng(valence).uniform(-0.1, 0.1, (count, 2))
    rays = rays_at(np.tile([0.0, 0.0, 2.0], (count, 1)), lens)
    return _leaks("vertex rays", tracer.closest, mesh, rays)


@sweep("2", "|c| m", (0.0, 1e2, 1e4, 1e6))
def any_vertex_rays(tracer: TracerUnderTest, distance: float) -> Measurement:
    """All vertices of a closed mesh in all directions, ever farther from the origin."""
    centre = np.array([0.6, 0.64, 0.48]) * distance
    mesh = single(sphere(16, 32, 2.0, centre))
    corners = np.unique(mesh.reshape(-1, 3), axis=0).astype(float)
    lens = single(centre + np.random.default_rng(3).uniform(-0.2, 0.2, (4, 3)))
    directions = single(np.concatenate([corners - origin for origin in lens]))
    rays = np.repeat(lens, len(corners), axis=0), directions
    return _leaks("vertex rays, any", tracer.any_closest, mesh, rays)


def _leaks(case: str, closest: ClosestHit, mesh: np.ndarray, rays: Rays) -> Measurement:
    hits = oracle_hits(mesh, rays)
    # The mesh is closed and holds the rays' origins: the oracle itself may not leak.
    if (hits.triangle < 0).any():
        raise AssertionError(f"the oracle leaks in {case}")
    bound = Bound(0, LEAKING, "a closed mesh has no gaps")
    return compared(case, bound, closest, mesh, rays, functools.partial(leaks, hits=hits))


@sweep("2", "N", (4, 16, 64))
def lens_on_a_vertex(tracer: TracerUnderTest, views: int) -> Measurement:
    """A wall in focus whose vertices lie where the pixels' rays meet: all N^2 aim at one."""
    slab = Slab(CAMERA, views, 16)
    edge = slab.pixel_tangents()[[0, -1]] * CAMERA.focus_distance_m
    size = edge[1] - edge[0]
    cell = size / 15
    corner = [edge[0] - cell, edge[0] - cell, CAMERA.focus_distance_m]
    side = size + 2 * cell
    wall = single(grid(17, 17, corner, [side, 0, 0], [0, side, 0]))
    pixels = np.stack(np.meshgrid(np.arange(16), np.arange(16)), -1).reshape(-1, 2)
    pixels = pixels[:: max(1, views // 8)]
    rays = one_by_one(slab_rays(slab, pixels))
    return measured(
        "lens on a vertex",
        Bound(0, LEAKING, "a wall has no gaps"),
        lambda: (moeller_trumbore(wall, *rays)[0] < 0).mean(),
        lambda: (tracer.slab_hits(wall, slab, pixels)[0] < 0).mean(),
    )
