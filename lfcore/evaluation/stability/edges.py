"""Cases 1 and 2: rays aimed at the edges and vertices of closed meshes.

Error: share of the rays that leak; bound: none may.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lfcore.evaluation.stability.judge import leaks, row, truth
from lfcore.evaluation.stability.naive import moeller_trumbore
from lfcore.evaluation.stability.rows import Row
from lfcore.evaluation.stability.shapes import grid, rays_at, sphere
from lfcore.evaluation.stability.subject import CAMERA, Subject
from lfcore.optics.slab import Slab


def edge_rays(subject: Subject) -> Iterator[Row]:
    """Points of edges of a sphere seen from within, ever finer."""
    for columns in (12, 50, 100):
        mesh = np.float32(sphere(max(6, columns // 4), columns, 2.0))
        rng = np.random.default_rng(columns)
        ahead = mesh[(mesh[:, :, 2] > 0.3).all(1)].astype(float)
        chosen = rng.integers(0, len(ahead), subject.rays)
        side, share = rng.integers(0, 3, subject.rays), rng.uniform(0, 1, (subject.rays, 1))
        points = ahead[chosen, side] * share + ahead[chosen, (side + 1) % 3] * (1 - share)
        rays = rays_at(points, rng.uniform(-0.1, 0.1, (subject.rays, 2)))
        yield _leaks(subject, "edge rays", "columns", columns, mesh, rays)


def vertex_rays(subject: Subject) -> Iterator[Row]:
    """The pole of a sphere seen from within, of ever more triangles."""
    for valence in (4, 8, 64, 200):
        mesh = np.float32(sphere(8, valence, 2.0))
        count = max(50, 2 * subject.rays // valence)  # the oracle settles each of these by integers
        lens = np.random.default_rng(valence).uniform(-0.1, 0.1, (count, 2))
        rays = rays_at(np.tile([0.0, 0.0, 2.0], (count, 1)), lens)
        yield _leaks(subject, "vertex rays", "valence", valence, mesh, rays)


def any_vertex_rays(subject: Subject) -> Iterator[Row]:
    """All vertices of a closed mesh in all directions, ever farther from the origin."""
    for distance in (0.0, 1e2, 1e4, 1e6):
        centre = np.array([0.6, 0.64, 0.48]) * distance
        mesh = np.float32(sphere(16, 32, 2.0, centre))
        corners = np.unique(mesh.reshape(-1, 3), axis=0).astype(float)
        lens = np.float32(centre + np.random.default_rng(3).uniform(-0.2, 0.2, (4, 3)))
        directions = np.float32(np.concatenate([corners - origin for origin in lens]))
        rays = np.repeat(lens, len(corners), axis=0), directions
        hits = truth(mesh, *rays)
        yield row(
            "vertex rays, any",
            "|c| m",
            distance,
            0.0,
            lambda mesh=mesh, rays=rays, hits=hits: leaks(moeller_trumbore(mesh, *rays), hits),
            lambda mesh=mesh, rays=rays, hits=hits: leaks(subject.any_closest(mesh, *rays), hits),
        )


def _leaks(subject, case, parameter, value, mesh, rays) -> Row:
    hits = truth(mesh, *rays)
    # The mesh is closed and holds the rays' origins: the oracle itself may not leak.
    if (hits.triangle < 0).any():
        raise AssertionError(f"the oracle leaks in {case}")
    return row(
        case,
        parameter,
        value,
        0.0,
        lambda: leaks(moeller_trumbore(mesh, *rays), hits),
        lambda: leaks(subject.closest(mesh, *rays), hits),
    )


def lens_on_a_vertex(subject: Subject) -> Iterator[Row]:
    """A wall in focus whose vertices lie where the pixels' rays meet: all N^2 aim at one."""
    for views in (4, 16, 64):
        slab = Slab(CAMERA, views, 16)
        edge = slab.pixel_tangents()[[0, -1]] * CAMERA.focus_distance_m
        size = edge[1] - edge[0]
        cell = size / 15
        corner = [edge[0] - cell, edge[0] - cell, CAMERA.focus_distance_m]
        side = size + 2 * cell
        wall = np.float32(grid(17, 17, corner, [side, 0, 0], [0, side, 0]))
        pixels = np.stack(np.meshgrid(np.arange(16), np.arange(16)), -1).reshape(-1, 2)
        pixels = pixels[:: max(1, views // 8)]
        x, y = (slab.pixel_tangents()[pixels[:, k], None, None] for k in (0, 1))
        s = slab.lens_positions()
        parts = np.broadcast_arrays(
            s[None, None], s[None, :, None], x - s * CAMERA.delta, y - s[:, None] * CAMERA.delta
        )
        s, t, dx, dy = (np.float32(part).ravel() for part in parts)
        zeros = np.zeros_like(s)
        rays = np.stack([s, t, zeros], 1), np.stack([dx, dy, zeros + 1], 1)
        count = len(pixels) * views**2
        yield row(
            "lens on a vertex",
            "N",
            views,
            0.0,
            lambda rays=rays, wall=wall: float((moeller_trumbore(wall, *rays)[0] < 0).mean()),
            lambda wall=wall, slab=slab, pixels=pixels, count=count: float(
                (subject.slab_hits(wall, slab, pixels)[0] < 0).sum() / count
            ),
        )


CASES = (edge_rays, vertex_rays, any_vertex_rays, lens_on_a_vertex)
