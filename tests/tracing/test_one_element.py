"""Blocks of the rays of one element, against the oracle."""

import numpy as np
import pytest
import trimesh
from tracing_scenes import CAMERA, check_hits, colours, scene, soup, tracer_of

from lfcore.optics.bundles import macropixels
from lfcore.optics.slab import Slab
from lfcore.scene.appearance import POINT, Light

LAMP = Light(POINT, (0.6, -1.5, 0.5), (0.9, 0.9, 0.9))


def plate(z, size=40.0):
    """One triangle that fills the picture."""
    return np.array([[[-size, -size, z], [size, -size, z], [0, size, z]]])


def edge_on():
    """Triangles whose planes go through the lens: rays see them from both sides."""
    rng = np.random.default_rng(3)
    corners = rng.uniform([0, -0.6, 0.8], [0, 0.6, 4.0], (40, 3, 3))
    corners[..., 0] = (
        rng.uniform(-0.04, 0.04, (40, 1)) + rng.uniform(-0.02, 0.02, (40, 1)) * corners[..., 2]
    )
    return corners


SEEN = np.array([0.0146, -0.0146, 1.0])
"""The middle of what the first of two_pixels sees a metre away: a square of 25 mm."""


def tiles(count, depths):
    """Rectangles along rows and columns of what a pixel sees, some at the same depth."""
    rng = np.random.default_rng(count)
    lo = rng.uniform(-0.015, 0.005, (count, 2))
    hi = lo + rng.uniform(0.004, 0.015, (count, 2))
    z = 0.02 * rng.integers(0, depths, count)
    a, b, c, d = (
        np.stack([x[:, 0], y[:, 1], z], 1) for x, y in ((lo, lo), (hi, lo), (hi, hi), (lo, hi))
    )
    return SEEN + np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def crossing(count, seed):
    """Triangles about as large as what a pixel sees, that pass through each other."""
    return SEEN + np.random.default_rng(seed).uniform(-0.03, 0.03, (count, 3, 3))


FEW = {
    "tiles": np.concatenate([tiles(12, 3), plate(1.5)]),
    "tiles in one plane": np.concatenate([tiles(10, 1), plate(1.0)]),
    "crossing": np.concatenate([crossing(8, 1), plate(1.0)]),
    "crossing before nothing": crossing(12, 2),
    "mesh": np.concatenate([trimesh.creation.icosphere(1, 0.012).triangles + SEEN, plate(1.1)]),
}
SCENES = {
    **FEW,
    "large": soup(60, 1, 1.0),
    "hidden": np.concatenate([soup(100, 4), plate(0.5)]),
    "before a wall": np.concatenate([soup(20, 5), plate(5.0)]),
    "edge-on": np.concatenate([edge_on(), plate(6.0)]),
}


def two_pixels(slab):
    return [[slab.pixels // 2, slab.pixels // 2 - 1], [1, slab.pixels - 2]]


@pytest.mark.parametrize("name", ["large", "hidden", "before a wall", "edge-on", *FEW])
def test_triangles_are_the_oracles(device, name):
    slab = Slab(CAMERA, 40, 24)
    check_hits(tracer_of(SCENES[name], device, outer=1), slab, two_pixels(slab), least=0.1)


@pytest.mark.kernels
@pytest.mark.parametrize("name", ["mesh", "crossing"])
def test_few_triangles_have_the_oracles_colours(device, name):
    """A mesh of few triangles to a block, and one whose triangles pass through each other."""
    slab = Slab(CAMERA, 100, 24)
    world, pixels = scene(FEW[name], lights=[LAMP]), two_pixels(slab)
    found, truth = colours(world, macropixels(slab, pixels), pixels, device, outer=1)
    assert np.ptp(found) > 0.1
    assert (np.abs(found - truth).max(-1) > 1e-4).mean() < 5e-3
