"""The slab's rays and the sensor planes scattered from them, against hand-computed values."""

import dataclasses

import numpy as np
import pytest
from plain_scenes import CAMERA, scene, wall

from lfcore import SensorPlane, Slab
from lfcore.oracle.planes import form_plane
from lfcore.oracle.slab import all_pixels, slab_hits, slab_rays, trace

SLAB = Slab(CAMERA, views=4, pixels=6)
WHOLE = {"focus_m": 2.0, "f_number": 2.0, "aperture": "square"}


def test_rays_start_on_the_lens_and_meet_in_the_focal_plane():
    origins, directions = slab_rays(SLAB, [[0, 5], [3, 2]])
    assert origins.shape == directions.shape == (2, 4, 4, 3)
    assert origins.dtype == directions.dtype == np.float32
    # Radius 0.05 / 4: samples at +-1/8 and +-3/8 of 25 mm, s along the last axis.
    s = np.array([-3, -1, 1, 3]) / 8 * 0.025
    np.testing.assert_allclose(origins[1, 2], np.stack([s, [s[2]] * 4, [0] * 4], -1), rtol=1e-6)
    focused = origins + 2.0 * directions
    # Image distance 0.05 / (1 - 0.025), pixels a sixth of 36 mm over it.
    pitch = 0.036 / (0.05 / 0.975) / 6
    for pixel, (u, v) in enumerate([(-2.5, 2.5), (0.5, -0.5)]):
        expected = [2 * pitch * u, 2 * pitch * v, 2]
        np.testing.assert_allclose(focused[pixel], np.tile(expected, (4, 4, 1)), rtol=1e-5)


def test_depth_and_picture_of_a_wall():
    hits = slab_hits(scene(wall(3)), SLAB, [[0, 0], [5, 3]])
    np.testing.assert_allclose(hits.t, 3.0)
    pixels, seen = all_pixels(SLAB), []
    light = trace(scene(wall(3)), SLAB, pixels, progress=lambda *step: seen.append(step))
    assert light.shape == (36, 4, 4, 3) and seen[-1] == (36, 36)
    np.testing.assert_allclose(light, np.broadcast_to([0.05, 0.1, 0.15], light.shape))
    assert pixels[:2].tolist() == [[0, 0], [1, 0]]


def test_the_left_of_the_picture_sees_the_left_of_the_scene():
    left = wall(3) - np.float32([10, 0, 0])
    light = trace(scene(left), SLAB, all_pixels(SLAB)).reshape(6, 6, 4, 4, 3)
    assert (light[:, :2, ..., 0] < 0.1).all() and (light[:, 4:, ..., 0] > 0.6).all()


@pytest.mark.parametrize("bilinear", [False, True])
def test_the_recorded_focus_is_the_mean_over_the_lens(bilinear):
    light = np.random.default_rng(0).uniform(0, 1, (6, 6, 4, 4, 3))
    picture = form_plane(SLAB, SensorPlane(**WHOLE), light, bilinear=bilinear)
    np.testing.assert_allclose(picture, light.mean((2, 3)))


@pytest.mark.parametrize("bilinear", [False, True])
def test_normalisation(bilinear):
    light = np.full((6, 6, 4, 4, 3), 0.5)
    circle = {"focus_m": 2.0, "f_number": 3.0, "aperture": "circle"}  # the 2 x 2 inside
    assert SensorPlane(**circle).mask(SLAB).sum() == 4
    whole = form_plane(SLAB, SensorPlane(**circle), light, bilinear=bilinear)
    dimmed = form_plane(SLAB, SensorPlane(**circle, normalise="lens"), light, bilinear=bilinear)
    np.testing.assert_allclose(whole, 0.5)
    np.testing.assert_allclose(dimmed, 0.5 * 4 / 16)
    moved = dict(circle, focus_m=0.5)
    # Nothing recorded lies outside: at the borders fewer rays arrive, and they are counted.
    np.testing.assert_allclose(
        form_plane(SLAB, SensorPlane(**moved), light, bilinear=bilinear), 0.5
    )


def focus_for_shift(pixels):
    """A focus distance that moves the rays of neighbouring lens columns apart by ``pixels``."""
    delta = SLAB.camera.delta + pixels * SLAB.pixel_pitch / SLAB.lens_pitch_m
    return 1 / delta


@pytest.mark.parametrize("bilinear", [False, True])
def test_rays_that_meet_elsewhere_are_gathered_there(bilinear):
    """Shifts by whole pixels from column to column, rows alike: the middle ones -1/2, 1/2."""
    slab = Slab(CAMERA, views=3, pixels=6)
    delta = CAMERA.delta + slab.pixel_pitch / slab.lens_pitch_m
    plane = SensorPlane(1 / delta, 2.0, "square")
    np.testing.assert_allclose(plane.shifts(slab), [-1, 0, 1], atol=1e-12)
    light = np.zeros((6, 6, 3, 3, 3))
    for j in range(3):
        for i in range(3):
            light[3 - (j - 1), 2 - (i - 1), j, i] = 1
    picture = form_plane(slab, plane, light, bilinear=bilinear)
    expected = np.zeros((6, 6, 3))
    expected[3, 2] = 1
    np.testing.assert_allclose(picture, expected, atol=1e-9)


def test_half_a_pixel_goes_up_or_is_shared():
    plane = SensorPlane(focus_for_shift(1.0), 2.0, "square")
    shifts = plane.shifts(SLAB)
    np.testing.assert_allclose(shifts, [-1.5, -0.5, 0.5, 1.5])
    exact = dataclasses.replace(plane, focus_m=focus_for_shift(0.5))
    np.testing.assert_allclose(exact.shifts(SLAB), [-0.75, -0.25, 0.25, 0.75])
    light = np.zeros((6, 6, 4, 4, 3))
    light[2, 3, 2, 0] = 16.0
    dimmed = dataclasses.replace(exact, normalise="lens")
    nearest = form_plane(SLAB, dimmed, light)[..., 0]
    assert nearest[2, 2] == 1 and nearest.sum() == 1  # 3 - 0.75 -> 2, 2 + 0.25 -> 2
    shared = form_plane(SLAB, dimmed, light, bilinear=True)[..., 0]
    expected = np.zeros((6, 6))
    expected[2:4, 2:4] = np.outer([0.75, 0.25], [0.75, 0.25])
    np.testing.assert_allclose(shared, expected, atol=1e-12)


def test_magnification_scales_about_the_centre():
    camera = dataclasses.replace(CAMERA, focus_m=0.1)
    slab = Slab(camera, views=1, pixels=8)
    plane = SensorPlane(np.inf, 2.0, "square", keep_magnification=True)
    assert plane.magnification(slab) == pytest.approx(0.5)  # v = 100 mm to v' = 50 mm
    light = np.arange(64.0).reshape(8, 8, 1, 1, 1) * np.ones(3)
    picture = form_plane(slab, plane, light)
    assert (picture[:2] == 0).all() and (picture[:, 6:] == 0).all()
    # Pixel 2 of the plane receives columns at (u - 3.5) / 2 + 3.5 in [1.5, 2.5): u = 0 and 1.
    np.testing.assert_allclose(picture[2, 2, 0], light[:2, :2].mean((0, 1))[0, 0, 0])
