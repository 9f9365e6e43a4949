"""Light above white: in sums of planes, in the codes of frames, and as the oracle shades it."""

import dataclasses

import numpy as np
import pytest
from plain_scenes import wall
from tracing_scenes import colours, lit_soup, scene, traced, tracer_of

import lfcore
from lfcore.optics import bundles
from lfcore.optics.slab import Slab
from lfcore.oracle import colour as truth
from lfcore.scene.appearance import POINT, Light
from lfcore.scene.needs import Needs
from lfcore.storage.layout import FrameLayout

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize("stops", [1, 5, 12, 16])
@pytest.mark.parametrize("kind", ["views", "macropixels"])
def test_sums_hold_all_stops(kind, stops):
    light = 0.7 * 2.0**stops
    world = scene(wall(9.0, 1e-3), background=(light, 0.01, 0.9), clip=False)
    assert Needs.of(world).stops == stops
    layout, plane = FrameLayout(kind, 8, 12), lfcore.SensorPlane(3.0, 2.0)
    picture = traced(tracer_of(world), layout, [plane], frames=False)[1].pictures()[0]
    middle = picture[1:-1, 1:4]
    # At sixteen stops a half is 256, and rays of a row are rounded by unlike parts of one.
    np.testing.assert_allclose(middle[..., 0], light, rtol=1e-6)
    np.testing.assert_allclose(middle[..., 1:], np.broadcast_to([0.01, 0.9], (10, 3, 2)), atol=3e-4)


def test_unclipped_shading_is_the_oracles():
    soup = lit_soup()
    light = Light(POINT, (1.0, -2.0, 0.5), (30.0, 20.0, 10.0), 2.0, True)
    world = dataclasses.replace(soup, clip=False, lights=[light], background=(3.0, 2.0, 1.0))
    rays = bundles.views(Slab(world.camera, 4, 24), np.array([[0, 0], [3, 2]]))
    found, expected = colours(world, rays)
    assert expected.max() > 5
    error = np.abs(found - expected).max(-1) / np.maximum(1, expected.max(-1))
    assert (error > 0.01).mean() < 5e-3 and np.median(error) < 1e-4


@pytest.mark.parametrize("form", ["yuv444p10le", "yuv420p12le"])
@pytest.mark.parametrize("light", [0.001, 0.4, 1.0, 30.0, 64.0])
def test_frames_have_the_codes_of_the_standard(form, light):
    world = scene(wall(9.0, 1e-3), background=(light,) * 3, ambient=(64.0,) * 3, clip=False)
    layout = FrameLayout("views", 2, 16, pixel_format=form, peak=64.0)
    frames = traced(tracer_of(world), layout)[0]
    luma = layout.format.views(frames, layout.frame_width, layout.frame_height)[0][:, 1, 1]
    scale = 1 << (layout.format.bits - 8)
    assert np.abs(luma - scale * (16 + 219 * truth.pq(light / 64))).max() <= 0.51
