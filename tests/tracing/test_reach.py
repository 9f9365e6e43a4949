"""What is left out of a scene is met by no ray, casts no shadow that is seen and lights nothing."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lfcore import FrameLayout, SensorPlane, Slab, Tracer, open_device
from lfcore.evaluation.stability.tested_tracer import CAMERA, bare_scene
from lfcore.oracle.slab import all_pixels, slab_hits
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light
from lfcore.tracing import reach
from lfcore.tracing.bvh import build_bvh

pytestmark = pytest.mark.kernels

WHITE = (1.0, 1.0, 1.0)


def soup(seed, count=300):
    """Triangles on all sides of the camera, many of them beside what it sees."""
    rng = np.random.default_rng(seed)
    centres = rng.uniform(-3, 3, (count, 1, 3)) + [0, 0, 1]
    return np.float32(centres + rng.normal(0, 0.4, (count, 3, 3)))


def pictures(scene, bvh):
    slab = Slab(scene.camera, 8, 24)
    tile = FrameLayout("macropixels", 8, 24).tile(0, 0, 24, 24)
    planes = [SensorPlane(scene.camera.focus_m, scene.camera.f_number)]
    tracing = Tracer(scene, bvh, open_device(threads=1)).trace_tile(slab, tile, planes)
    frames = [chunk.frames.copy() for chunk in tracing]
    return np.concatenate(frames), tracing.plane_sums.sums


@settings(max_examples=15)
@given(seed=st.integers(0, 1000), focus=st.sampled_from([0.06, 0.5, 2.0, float("inf")]))
def test_what_no_ray_meets_is_all_that_is_left_out(seed, focus):
    camera = replace(CAMERA, focus_m=focus)
    triangles = soup(seed, 80)
    keep = reach.seen(triangles, camera)
    slab = Slab(camera, 3, 6)
    hits = slab_hits(bare_scene(triangles[~keep], camera=camera), slab, all_pixels(slab))
    assert (hits.triangle < 0).all()


LIGHTS = {
    "none": [],
    "near": [Light(POINT, (-1.0, -2.0, 0.5), WHITE)],
    "behind": [Light(POINT, (0.5, 0.2, -4.0), WHITE)],
    "sun": [Light(DIRECTIONAL, (0.6, -0.64, -0.48), WHITE)],
}


@pytest.mark.parametrize("lights", LIGHTS)
def test_pictures_do_not_change_by_a_bit(lights):
    scene = bare_scene(soup(1, 2000), lights=LIGHTS[lights])
    bvh = build_bvh(scene.triangles)
    lean, pruned = reach.lean(scene, bvh, scene.camera)
    gone = scene.triangle_count - lean.triangle_count
    assert gone > (200 if lights == "none" else 20)
    assert len(pruned.leaf_ids[pruned.leaf_ids >= 0]) == lean.triangle_count
    for one, other in zip(pictures(scene, bvh), pictures(lean, pruned), strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_shadow_from_beyond_the_picture_stays():
    """The plate is outside the field of view; its shadow is not."""
    wall = [[[-9, -9, 4], [9, -9, 4], [0, 9, 4]]]
    plate = [[[-4, -4, 2], [-3, -4, 2], [-3, 4, 2]]]
    far = [[[20, -1, 2], [21, -1, 2], [21, 1, 2]]]
    light = Light(POINT, (-8.0, 0.0, 0.0), WHITE)
    scene = bare_scene(np.float32(wall + plate + far), lights=[light])
    assert reach.seen(scene.triangles, scene.camera).tolist() == [True, False, False]
    assert reach.reached(scene, scene.camera).tolist() == [True, True, False]


def test_lights_on_the_far_side_reach_nothing():
    wall = np.float32([[[-1, -1, 2], [1, -1, 2], [0, 1, 2]]])
    before, beyond = (Light(POINT, (0, 0, z), WHITE) for z in (1.0, 3.0))
    sun, lamp = (Light(DIRECTIONAL, (0, 0, z), WHITE) for z in (-1.0, 1.0))
    grazing, black = Light(DIRECTIONAL, (1, 0, 0), WHITE), Light(POINT, (0, 0, 1), (0, 0, 0))
    scene = bare_scene(wall, lights=[before, beyond, sun, lamp, grazing, black])
    assert reach.reaching(scene, scene.camera) == [before, sun, grazing]
    smooth = replace(scene, normals=np.zeros((1, 3, 3), np.float32))
    assert reach.reaching(smooth, scene.camera) == [before, beyond, sun, lamp, grazing]
