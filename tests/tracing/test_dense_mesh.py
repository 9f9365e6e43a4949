"""Interpolation on triangles far smaller than a block, against the oracle."""

import numpy as np
import pytest
from tracing_scenes import mesh, scene, unit

from lfcore.optics.bundles import Bundles
from lfcore.oracle.shading import radiance
from lfcore.scene.appearance import DIRECTIONAL, Light
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer

DEPTH, BLOCK_WIDTH_M, SIDE = 3.0, 1.0, 24
STEP = BLOCK_WIDTH_M / 16 / DEPTH


def dense_mesh(edge_m):
    """A tilted square of SIDE x SIDE cells with wavy normals and colours that change slowly."""
    n = np.arange(SIDE + 1)
    x, y = np.meshgrid((n - SIDE / 2) * edge_m, (n - SIDE / 2) * edge_m)
    u, v = np.meshgrid(n / SIDE, n / SIDE)
    normals = np.stack([np.sin(8 * np.pi * u) / 2, np.cos(6 * np.pi * v) / 2, -np.ones_like(u)], -1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)

    return scene(
        mesh(np.stack([x, y, DEPTH + 0.2 * x + 0.3 * y], -1)),
        normals=mesh(normals),
        colours=mesh(np.stack([u, v, 1 - u], -1)),
        lights=[Light(DIRECTIONAL, unit(0.3, -0.4, -1), (0.6, 0.6, 0.6), casts_shadows=False)],
    )


@pytest.mark.kernels
@pytest.mark.parametrize("edge_m", [1e-2, 1e-3, 1e-4])
def test_colours_and_normals_of_small_triangles_are_the_oracles(edge_m):
    """Blocks 1 m wide, in each of which one ray is aimed at the mesh."""
    world, rng = dense_mesh(edge_m), np.random.default_rng(1)
    aim = rng.uniform(-0.45, 0.45, (200, 2)) * SIDE * edge_m
    column, row = rng.integers(0, 16, (2, len(aim)))
    elements = np.zeros((len(aim), 4), np.float32)
    elements[:, 2:] = aim / (DEPTH + aim @ [0.2, 0.3])[:, None]
    elements[:, 2:] -= (np.stack([column, row], 1) - 7.5) * STEP
    bundles = Bundles(elements, np.float32([0, 0, STEP, STEP]), 16, 16, STEP)
    tracer = Tracer(world, build_bvh(world.triangles), single_rays=False, mipmaps=False)
    aimed = np.arange(len(aim)), row, column
    true = radiance(world, *(rays[aimed] for rays in bundles.rays()))
    assert (true != np.float32(world.background)).any(axis=1).all()
    assert np.abs(tracer.bundle_radiance(bundles)[aimed] - true).max() * 255 < 0.05
