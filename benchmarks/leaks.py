"""Rays at edges and vertices of closed surfaces: how many pass through.

    python -m benchmarks.leaks --rays 1e8

Single rays are aimed at edges and vertices of a sphere around them.  Blocks of every kind look at
the sphere from within, and at a wall with a vertex on a ray of each pixel.  Status 1 if a ray of
any kind met nothing.
"""

import argparse
import dataclasses
import sys

import numpy as np
import pandas as pd
import trimesh

from lfcore.evaluation.stability.tested_tracer import CAMERA, bare_scene
from lfcore.opencl.device import open_device
from lfcore.optics.bundles import views
from lfcore.optics.slab import Slab
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer

WIDE = dataclasses.replace(CAMERA, f_number=1.0)
PIXELS, MARGIN = 256, 32
SPREADS = ((1.7, 2.3), (0.6, 0.8), (1.99, 2.01), (5.0, 40.0))
"""Depths of a wall's vertices in metres: in focus, near, nearly flat, far."""


def rough_wall(
    slab: Slab, pixels: np.ndarray, depths_m: tuple[float, float], rng: np.random.Generator
) -> np.ndarray:
    """Triangles (T, 3, 3) of a wall without holes: one vertex on a ray of each of K x K pixels."""
    count = len(pixels)
    s, t = rng.choice(slab.lens_positions(), (2, count, count))
    tangent = slab.pixel_tangents()[pixels]
    z = rng.uniform(*depths_m, (count, count))
    x = s * (1 - z * slab.camera.delta) + z * tangent
    y = t * (1 - z * slab.camera.delta) + z * tangent[:, None]
    grid = np.stack([x, y, z], -1).astype(np.float32)
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    return np.stack([a, b, c, a, c, d], 2).reshape(-1, 3, 3)


def sphere(rng: np.random.Generator) -> np.ndarray:
    """Triangles of a sphere around the lens."""
    mesh = trimesh.creation.icosphere(int(rng.integers(2, 6)), radius=rng.uniform(1.5, 9))
    return (mesh.triangles + rng.uniform(-0.3, 0.3, 3)).astype(np.float32)


def tracer_of(triangles: np.ndarray, **options) -> Tracer:
    scene = bare_scene(triangles)
    return Tracer(scene, build_bvh(scene.triangles), open_device(), mipmaps=False, **options)


def single_rays(rng: np.random.Generator) -> np.ndarray:
    """What a million rays meet: half are aimed at vertices, half at edges."""
    triangles, count = sphere(rng), 1_000_000
    origins = rng.uniform(-0.4, 0.4, (count, 3)).astype(np.float32)
    face, along = rng.integers(0, len(triangles), count), rng.random((count, 1))
    along[: count // 2] = 0
    aim = triangles[face, 0] * (1 - along) + triangles[face, 1] * along
    return tracer_of(triangles).closest_hit(origins, (aim - origins).astype(np.float32))[0]


def blocks(rng: np.random.Generator, *, wall: bool) -> np.ndarray:
    """What the rays of some pixels or views meet, in blocks of any number of elements."""
    slab = Slab(WIDE, int(rng.choice([2, 3, 4, 8, 16, 32])), PIXELS)
    side = min(160, 512 // slab.views)
    first = int(rng.integers(MARGIN, PIXELS - side - MARGIN))
    seen, reach = np.arange(first, first + side), np.arange(first - MARGIN, first + side + MARGIN)
    corners = (
        rough_wall(slab, reach, SPREADS[rng.integers(len(SPREADS))], rng) if wall else sphere(rng)
    )
    tracer = tracer_of(corners, outer=int(rng.choice([1, 2, 4])), single_rays=False)
    if rng.random() < 0.5:
        pixels = np.stack(np.meshgrid(seen, seen), -1).reshape(-1, 2)
        return tracer.slab_hits(slab, pixels)[0]
    lens = np.unique(rng.integers(0, slab.views, (16, 2)), axis=0)
    triangle, _ = tracer.bundle_hits(views(slab, lens), lens)
    return triangle.reshape(len(lens), PIXELS, PIXELS)[:, seen][:, :, seen]


KINDS = {
    "single rays in a sphere": single_rays,
    "blocks in a sphere": lambda rng: blocks(rng, wall=False),
    "blocks at the vertices of a wall": lambda rng: blocks(rng, wall=True),
}


def main() -> int:
    parser = argparse.ArgumentParser("benchmarks.leaks", description=__doc__)
    parser.add_argument("--rays", type=float, default=1e6, help="at least so many of a kind (1e6)")
    parser.add_argument("--seed", type=int, default=1, help="seed of the random numbers (1)")
    arguments = parser.parse_args()
    rows = []
    for kind, trace in KINDS.items():
        rng, rays, missed = np.random.default_rng(arguments.seed), 0, 0
        while rays < arguments.rays:
            triangle = trace(rng)
            rays, missed = rays + triangle.size, missed + int((triangle < 0).sum())
        rows.append({"rays": kind, "number": rays, "pass through": missed})
    print(pd.DataFrame(rows).to_markdown(index=False))
    return int(any(row["pass through"] for row in rows))


if __name__ == "__main__":
    sys.exit(main())
