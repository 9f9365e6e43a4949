"""Points of surfaces that glow: their own cosine, and what never shadows them."""

import dataclasses

import numpy as np
import pytest
import trimesh
from tracing_scenes import CAMERA, WALL, bent_normals, colours, scene, soup

from lfcore.optics.bundles import macropixels
from lfcore.optics.slab import Slab
from lfcore.oracle.slab import all_pixels, trace
from lfcore.scene.appearance import POINT, Light, Material
from lfcore.scene.needs import Needs
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.reach import lean

pytestmark = pytest.mark.kernels

BEHIND = [[[-1, -1, -6], [1, -1, -6], [0, 1, -6]]]
WHITE = (0.9, 0.9, 0.9)


# By blocks of one element, one by one, and as the scene asks for.
WAYS = [{"outer": 1, "single_rays": False}, {"outer": 1, "single_rays": True}, {}]


def panel(middle, normal):
    """A point above a wall's panel, which it would see nothing through."""
    return Light(POINT, middle, WHITE, 2.0, normal=normal)


def world(normals=False):
    """A ball with a light inside and a panel, around it what casts shadows, before a wall."""
    ball = trimesh.creation.icosphere(1, radius=0.4).triangles + (0.5, -0.3, 3.0)
    triangles = np.concatenate([BEHIND, soup(30, 1, 0.5), ball, soup(20, 4, 0.5), WALL])
    inside = Light(POINT, (0.55, -0.25, 2.95), (0.8, 0.6, 0.4), 1.0, own=(31, 31 + len(ball)))
    lights = [inside, panel((-1.0, -0.5, 2.0), (0.6, 0.0, 0.8))]
    changes = {"lights": lights, "ambient": (0.1, 0.1, 0.1)}
    if normals:
        changes["normals"] = bent_normals(triangles, np.random.default_rng(3), 0.1)
        changes["materials"] = [Material("gloss", (0.6, 0.6, 0.6), (0.3, 0.3, 0.3), 20.0)]
    return scene(triangles, **changes)


def every_pixel(views, pixels):
    slab = Slab(CAMERA, views, pixels)
    return macropixels(slab, all_pixels(slab))


@pytest.mark.parametrize("way", WAYS)
def test_emitters_are_the_oracles(device, way):
    found, expected = colours(world(), every_pixel(40, 4), device=device, **way)
    assert np.ptp(expected) > 0.15
    assert (np.abs(found - expected).max(-1) > 0.01).mean() < 2e-3


@pytest.mark.parametrize("way", WAYS[:2])
def test_spots_are_the_oracles(device, way):
    """A sharp one and one that fades from its axis on: the wall has both rims in it."""
    axis = (0.1, 0.2, np.sqrt(0.95))
    spots = [
        Light(POINT, (-0.5, -0.5, 0.5), WHITE, 3.0, normal=axis, cone=(1.0, 0.96)),
        Light(POINT, (0.6, 0.5, 0.5), WHITE, 3.0, normal=axis, cone=(0.98, 0.979)),
    ]
    here = dataclasses.replace(world(), lights=spots)
    assert Needs.of(here).spots and not Needs.of(here).emitters
    found, expected = colours(here, every_pixel(40, 4), device=device, **way)
    shades = len(np.unique(expected.round(2)))
    assert shades > 10 and (expected == 0.05).mean() > 0.1  # dark beside the cones
    assert (np.abs(found - expected).max(-1) > 0.01).mean() < 2e-3


def test_highlights_of_emitters_are_the_oracles(device):
    found, expected = colours(world(normals=True), every_pixel(16, 6), device=device, **WAYS[0])
    assert (np.abs(found - expected).max(-1) > 0.01).mean() < 4e-3


def test_own_triangles_and_cosines_matter():
    """What the other tests rely on: without either the oracle's picture is another."""
    here, slab = world(), Slab(CAMERA, 5, 8)
    pixels = all_pixels(slab)
    truth = trace(here, slab, pixels)
    for change in ({"own": (0, 0)}, {"normal": (0.0, 0.0, 0.0)}):
        lights = [dataclasses.replace(light, **change) for light in here.lights]
        other = trace(dataclasses.replace(here, lights=lights), slab, pixels)
        assert (np.abs(truth - other).max(-1) > 0.02).mean() > 0.02


def test_own_triangles_keep_their_numbers_when_others_are_left_out():
    here = world()
    small, _ = lean(here, build_bvh(here.triangles), CAMERA)
    assert len(small.triangles) < len(here.triangles)
    for before, after in zip(here.lights, small.lights, strict=True):
        kept = here.triangles[slice(*before.own)]
        np.testing.assert_array_equal(small.triangles[slice(*after.own)], kept)
