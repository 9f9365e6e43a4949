"""Shadows on blocks of one triangle or a few, whose occluders are found once a beam."""

import numpy as np
import pytest
from tracing_scenes import CAMERA, WALL, scene, soup, tracer_of, unit

from lfcore.optics.bundles import macropixels
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.oracle.intersect import closest_hits
from lfcore.oracle.shading import radiance, shade
from lfcore.oracle.slab import all_pixels, slab_rays
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light
from lfcore.storage.layout import FrameLayout

pytestmark = pytest.mark.kernels

LAMP = Light(POINT, (0.6, -1.5, 0.5), (0.9, 0.9, 0.9))
NEAR = 4 * 2.0**-24
"""Of the depth: rays that lie so close to each other may differ by rounding."""
SUN = Light(DIRECTIONAL, unit(-0.15, -0.25, -0.95), (0.7, 0.7, 0.7))
# Its plane passes through the lens: some rays of a beam see it from above, where the lamp is, and
# more from below.
FLOOR = [[[-9, -0.00925, 0.5], [9, -0.00925, 0.5], [0, -0.015, 12]]]
CANOPY = [[[0.19, -0.5, -1], [0.21, -0.5, 2.5], [2, -0.5, 0.8]]]


def crumbs(each):
    """Small triangles between the lamp and what nine pixels see of a wall: too many to keep."""
    rng = np.random.default_rng(4)
    lamp, across = np.array(LAMP.vector), np.linspace(-1.2, 1.2, 3)
    seen = np.stack([*np.meshgrid(across, across), np.full((3, 3), 5.0)], -1).reshape(9, 1, 1, 3)
    targets = seen + rng.uniform([-0.05, -0.05, 0], [0.05, 0.05, 0], (9, each, 1, 3))
    middle = lamp + (targets - lamp) * rng.uniform(0.6, 0.9, (9, each, 1, 1))
    return (middle + rng.normal(size=(9, each, 3, 3)) * 0.004).reshape(-1, 3, 3)


def one_element(world, device=None):
    """A tracer whose blocks are of one element each."""
    return tracer_of(world, device, outer=1, single_rays=False)


def fan(depth, spokes=8, size=32.0):
    """Triangles around the axis at ``depth``: the first edge is level, the third upright."""
    turn = np.arange(spokes + 1) * 2 * np.pi / spokes
    rim = np.round(np.stack([np.cos(turn), np.sin(turn)], -1), 6) * size
    rim = np.concatenate([rim, np.full((spokes + 1, 1), depth)], -1)
    return np.stack([np.full((spokes, 3), [0.0, 0.0, depth]), rim[:-1], rim[1:]], 1)


def worlds():
    return {
        "lamp": (np.concatenate([soup(40, 1, 0.5), WALL]), [LAMP]),
        "sun": (np.concatenate([soup(40, 2, 0.5), WALL]), [SUN]),
        "both": (np.concatenate([soup(40, 3, 0.5), WALL]), [LAMP, SUN]),
        "edge-on": (np.concatenate([CANOPY, FLOOR]), [LAMP]),
        "many": (np.concatenate([crumbs(250), WALL]), [LAMP]),
        "dust": (np.concatenate([soup(1000, 4, 0.05), WALL]), [LAMP, SUN]),
    }


def world(name):
    triangles, lights = worlds()[name]
    return scene(triangles, lights=lights, ambient=(0.1, 0.1, 0.1))


def unlike(first, second):
    """(R,) bool: which colours (R, 3) differ by more than shading is rounded."""
    return np.abs(first - second).max(-1) > 0.01


@pytest.mark.parametrize("name", worlds())
def test_shadows_are_the_oracles(device, name):
    here, slab = world(name), Slab(CAMERA, 40, 3)
    rays = macropixels(slab, all_pixels(slab))
    found = one_element(here, device).bundle_radiance(rays).reshape(-1, 3)
    origins, directions = (part.reshape(-1, 3) for part in slab_rays(slab, all_pixels(slab)))
    hits = closest_hits(here.triangles, origins, directions)
    expected = shade(here, directions, hits)
    assert np.ptp(expected) > 0.15
    differ = np.flatnonzero(unlike(found, expected))
    assert len(differ) < 2e-3 * len(found)
    # Each of them passes an edge so closely that rays beside it are what the tracer found.
    beside = NEAR * np.where(hits.triangle >= 0, hits.t, 5.0)[differ]
    explained = np.zeros(len(differ), bool)
    for turn in np.arange(8) * np.pi / 4:
        aside = beside[:, None] * [np.cos(turn), np.sin(turn), 0.0]
        seen = radiance(here, origins[differ] + aside, directions[differ])
        explained |= ~unlike(found[differ], seen)
    assert explained.all()


@pytest.mark.parametrize("name", ["lamp", "sun", "edge-on", "many"])
def test_shadows_are_those_of_single_rays(name):
    """Of pixels whose rays fill many blocks: beams have screens, and triangles part of a beam."""
    here, slab = world(name), Slab(CAMERA, 72, 24)
    rays = macropixels(slab, all_pixels(slab)[::29])
    tracers = one_element(here), tracer_of(here, single_rays=True)
    found, expected = (tracer.bundle_radiance(rays) for tracer in tracers)
    assert np.ptp(expected) > 0.15
    assert unlike(found, expected).mean() < 2e-5


@pytest.mark.parametrize("light", [(POINT, (0.0, 0.0, -2.0)), (DIRECTIONAL, (0.0, 0.0, -1.0))])
@pytest.mark.parametrize("views", [9, 65])
def test_no_light_comes_between_triangles(light, views):
    """Edges that occluders share run along rows, columns and diagonals of rays, to the last bit."""
    slab = Slab(CAMERA, views, 41)
    rays = macropixels(slab, np.array([[20, 20], [20, 3], [20, 31], [5, 20], [9, 9]]))
    dark, lit = (
        scene(triangles, lights=[Light(*light, (0.7, 0.7, 0.7))])
        for triangles in (np.concatenate([fan(-1.0), WALL]), WALL)
    )
    dark, lit = (one_element(each).bundle_radiance(rays) for each in (dark, lit))
    assert (dark == np.float32([0.1, 0.2, 0.3])).all()
    assert (lit > dark + 0.1).all()


@pytest.mark.parametrize("name", ["both", "many"])
def test_what_else_is_traced_changes_no_shadow(name):
    """Planes take packets by strips of pixels, frames alone one pixel after the other; without
    frames an aperture closes blocks, so that others are the first to ask for what casts shadows."""
    slab, tracer, plane = Slab(CAMERA, 72, 24), one_element(world(name)), [SensorPlane(2.0, 2.8)]
    tile, made = FrameLayout("macropixels", 72, 24, "raster", 1, "yuv444p").tile(0, 8, 24, 6), []
    for planes, frames in ((plane, True), ([], True), (plane, False)):
        tracing = tracer.trace_tile(slab, tile, planes, frames=frames)
        made.append(([chunk.frames.copy() for chunk in tracing], tracing.plane_sums.sums))
    (both, sums), (kept, _), (_, alone) = made
    assert np.ptp(kept) > 50
    np.testing.assert_array_equal(both, kept)
    np.testing.assert_array_equal(sums, alone)
