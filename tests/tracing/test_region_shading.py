"""Colours of blocks of one element, against the oracle."""

import dataclasses

import numpy as np
import pytest
from tracing_scenes import CAMERA, bent_normals, colours, mesh, scene, soup, unit

from lfcore.optics.bundles import macropixels
from lfcore.optics.slab import Slab
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light, Material

pytestmark = pytest.mark.kernels

LAMP = Light(POINT, (0.6, -1.5, 0.5), (0.9, 0.8, 0.7), 2.0, True)
NEAR = Light(POINT, (0.01, 0.01, 2.985), (0.4, 0.4, 0.4), 0.0, False)
SUN = Light(DIRECTIONAL, unit(-0.15, -0.25, -0.95), (0.7, 0.7, 0.7))
GRAZING = Light(DIRECTIONAL, unit(1.0, 0.0, -0.1), (0.7, 0.7, 0.7), 0.0, False)
PIXELS = [[12, 11], [1, 22], [6, 17]]


def tiles(z, size, count=12):
    """A wall of 2 count x count triangles, which blocks lie on or share."""
    y, x = np.mgrid[-count : count + 1, -count : count + 1] * size / count
    return mesh(np.stack([x, y, np.full_like(x, z)], -1))


def curved(lights, shininess=30.0, texture=None, bend=0.3):
    """A soup before a wall: smooth normals that turn by ``bend``, gloss, and a texture or none."""
    rng = np.random.default_rng(8)
    triangles = np.concatenate([soup(12, 5, 0.8), tiles(3.0, 0.9, 8), tiles(4.0, 9.0, 1)])
    gloss = (0.3, 0.3, 0.3)
    changes = {"lights": lights, "normals": bent_normals(triangles, rng, bend)}
    changes["materials"] = [Material("gloss", (0.7, 0.6, 0.5), gloss, shininess)]
    if texture is not None:
        changes["uvs"] = (triangles[..., :2] * 30).astype(np.float32)
        changes["textures"] = [texture]
        changes["materials"] = [Material("tiles", (0.7, 0.6, 0.5), gloss, shininess, texture=0)]
    return scene(triangles, **changes)


def noise():
    return np.random.default_rng(2).integers(0, 256, (16, 16, 3), np.uint8)


WORLDS = {
    "lamp": lambda: curved([LAMP]),
    "two lights": lambda: curved([LAMP, SUN]),
    "near light": lambda: curved([NEAR]),
    "terminator": lambda: curved([GRAZING]),
    "narrow highlights": lambda: curved([LAMP], 4000.0),
    "curled": lambda: curved([LAMP], bend=3.0),
}


def one_element(world, device=None, views=40, pixels=PIXELS[:2]):
    return colours(world, macropixels(Slab(CAMERA, views, 24), pixels), pixels, device, outer=1)


@pytest.mark.parametrize("name", WORLDS)
def test_colours_are_the_oracles(device, name):
    found, truth = one_element(WORLDS[name](), device)
    error = np.abs(np.clip(found, 0, 1) - truth).max(1)
    assert truth.std() > 0.05
    assert np.quantile(error, 0.98) < 2e-6  # beside edges rounding decides


@pytest.mark.parametrize("scale", [3, 12, 60, 120, 400])
def test_texel_tiles_of_any_size(device, scale):
    """From one texel, of ten bits of its root, in a block to more than a tile holds, in shadows."""
    world = curved([LAMP], texture=noise())
    world = dataclasses.replace(world, uvs=(world.triangles[..., :2] * scale).astype(np.float32))
    found, truth = one_element(world, device)
    error = np.abs(np.clip(found, 0, 1) - truth).max(1)
    assert np.quantile(error, 0.98) < 1e-3


def test_a_plane_through_the_lens_has_two_sides(device):
    """Some blocks of a packet see it from above and others from below: each in its own light."""
    slab, pixel = Slab(CAMERA, 70, 24), [[12, 11]]
    origins, directions = (a[0].astype(float) for a in macropixels(slab, pixel).rays())
    slope = directions[:, 0, 1] / directions[:, 0, 2]
    rows = origins[:, 0, 1]
    focus = (rows[-1] - rows[0]) / (slope[0] - slope[-1])
    # Half a row below the plane at the focus: what lies above it on the lens meets it before, what
    # lies below it beyond.
    level, step = rows[24], rows[1] - rows[0]
    tilt = (rows[0] + slope[0] * focus - level + step / 2) / focus
    corners = [(x, level + tilt * z, z) for x, z in ((0, 0.1), (-40, 90), (40, 90))]
    sun = Light(DIRECTIONAL, (0.0, 0.96, -0.28), (0.8, 0.7, 0.6), 0.0, False)
    world = scene(np.float32([corners]), lights=[sun])
    found, truth = (a.reshape(70, 70, 3) for a in one_element(world, device, 70, pixel))
    lit = truth[..., 0] > 0.3
    assert lit[rows > level + step].any() and not lit[rows < level - step].any()
    assert np.quantile(np.abs(found - truth).max(-1), 0.98) < 1e-4
