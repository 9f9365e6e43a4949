"""Halves of apertures, as the two pixels under a microlens see them."""

import argparse

import numpy as np
import pytest
from plain_scenes import refused
from scipy.ndimage import shift
from test_depth_slicing import CAMERA, everywhere, grey, seen, sliced

import lfcore
from lfcore import OpticsError, SensorPlane, Slab, dual_pixel_disparity, read_exr
from lfcore.cli import main
from lfcore.cli.values import aperture
from lfcore.optics.dual_pixel import disparity_map
from lfcore.optics.ray_cells import displaced_views
from lfcore.refocus.shift_sum import shift_sum_views
from lfcore.rendering.truth import circle_of_confusion

STRIPES = grey(lambda x, y: 0.5 + 0.4 * np.sin(6 * x) * np.sin(5 * y))


@pytest.mark.parametrize("shape", ["circle", "square", "polygon"])
@pytest.mark.parametrize("first", ["left", "top"])
def test_both_halves_are_the_whole_aperture(shape, first):
    slab, plane = Slab(CAMERA, 8, 16), SensorPlane(4.0, 1.0, shape)
    one, other = (half.mask(slab) for half in plane.halves(first))
    assert not (one & other).any() and ((one | other) == plane.mask(slab)).all()
    across = one.any(axis=0 if first == "left" else 1)
    assert across[:4].any() and not across[4:].any()


def test_the_mean_of_a_pair_is_the_picture():
    """Of nearest pixels, and by depth where nothing hides anything."""
    slab, plane = Slab(CAMERA, 4, 24), SensorPlane(6.0, 1.2)
    planes = [plane, *plane.halves()]
    views = np.random.default_rng(1).random((4, 4, 24, 24, 3), np.float32)
    whole, left, right = shift_sum_views(slab, views, planes)
    np.testing.assert_allclose((left + right) / 2, whole, atol=1e-6)
    views = displaced_views(Slab(CAMERA, 4, 48))
    rays = seen(views, [(12.0, STRIPES, everywhere)])
    whole, left, right = sliced(views, planes, 24, *rays)
    assert np.abs(left - right).max() > 0.02
    np.testing.assert_allclose(((left + right) / 2)[4:-4, 4:-4], whole[4:-4, 4:-4], atol=1e-6)


@pytest.mark.parametrize("shape", ["circle", "diamond", "polygon"])
@pytest.mark.parametrize("first", ["left", "top"])
def test_disparity_is_affine_in_inverse_depth_and_negative_before_the_focus(shape, first):
    slab, plane = Slab(CAMERA, 1, 64), SensorPlane(4.0, 1.2, shape, 5, 18.0)
    depth = np.array([2.0, 3.3, 4.0, 9.0, np.inf])
    found = dual_pixel_disparity(slab, plane, depth, first)
    line = np.polyfit(1 / depth[[0, 4]], found[[0, 4]].astype(float), 1)
    np.testing.assert_allclose(np.polyval(line, 1 / depth), found, atol=1e-6)
    np.testing.assert_array_equal(np.sign(found), [-1, -1, 0, 1, 1])


@pytest.mark.parametrize(
    ("shape", "share"), [("circle", 4 / (3 * np.pi)), ("square", 1 / 2), ("diamond", 1 / 3)]
)
def test_disparity_is_the_blur_times_the_distance_of_centroids(shape, share):
    slab, plane = Slab(CAMERA, 1, 64), SensorPlane(4.0, 1.2, shape)
    depth = np.array([2.0, 3.3, 9.0])
    blur = circle_of_confusion(slab, plane, depth)
    np.testing.assert_allclose(dual_pixel_disparity(slab, plane, depth), blur * share, rtol=1e-4)


def test_the_disparity_of_a_card_is_between_the_centroids_of_its_pictures():
    views, plane = displaced_views(Slab(CAMERA, 4, 96)), SensorPlane(4.0, 1.0, pixels=48)
    found, depths = [], np.array([2.5, 3.3, 4.0, 6.0, 20.0])
    for depth in depths:
        card = (depth, grey(lambda x, y: 0 * x + 1), lambda x, y, h=0.1 * depth: np.hypot(x, y) < h)
        left, right = sliced(views, plane.halves(), 48, *seen(views, [card]))[..., 0]
        places = [np.average(np.arange(48), weights=each.sum(0)) for each in (left, right)]
        found.append(places[1] - places[0])
    expected = dual_pixel_disparity(views.slab, plane, depths)
    np.testing.assert_allclose(found, expected, atol=0.03)
    assert expected[0] < -1 and expected[4] > 1


@pytest.mark.parametrize("depth", [3.0, 7.0])
def test_the_right_picture_of_texture_is_the_left_one_displaced(depth):
    """By the step at which the left picture, moved, is nearest to the right one."""
    views, plane = displaced_views(Slab(CAMERA, 4, 192)), SensorPlane(4.0, 1.0, pixels=96)
    wall = grey(lambda x, y: 0.5 + 0.4 * np.sin(40 / depth * x) * np.sin(31 / depth * (x + y)))
    rays = seen(views, [(depth, wall, everywhere)])
    left, right = sliced(views, plane.halves(), 96, *rays)[..., 0]
    steps = np.arange(-6, 6, 0.02)
    errors = [
        np.square(shift(left, (0, step), order=3) - right)[8:-8, 8:-8].mean() for step in steps
    ]
    expected = float(dual_pixel_disparity(views.slab, plane, depth))
    assert abs(expected) > 1
    assert steps[np.argmin(errors)] == pytest.approx(expected, abs=0.1)


def test_bad_halves_are_refused():
    for wrong in (lambda: SensorPlane(4.0, 1.0, half="middle"),
                  lambda: SensorPlane(4.0, 1.0).halves("right")):  # fmt: skip
        assert isinstance(refused("(half|first): unknown", wrong), OpticsError)
    assert aperture("left") == {"aperture": "circle", "half": "left"}
    assert aperture("polygon:5:18:top") == {
        "aperture": "polygon", "blades": 5, "rotation_deg": 18, "half": "top"
    }  # fmt: skip
    with pytest.raises(argparse.ArgumentTypeError, match="left, right"):
        aperture("square:inner")


@pytest.mark.kernels
def test_commands_write_a_pair_beside_its_mean_and_the_disparity_of_each_pixel(tmp_path):
    """A file's is the scene's, but for the codes of its depth; of another focus than recorded."""
    file, lens = tmp_path / "pair.npy", ["--focus", "3", "--dual-pixel"]
    assert not main(["render", "example", "--pixels", "64", *lens, "-o", str(file)])
    whole, left, right = np.load(file)
    np.testing.assert_allclose((left + right) / 2, whole, atol=1e-6)
    assert np.abs(left - right).max() > 0.01
    assert main(["render", "example", "--aperture", "left", "--dual-pixel", "-o", str(file)])
    scene = lfcore.load_scene("example")
    depth = lfcore.truth(scene, 1, 64)["depth_m"]
    traced = read_exr(tmp_path / "pair_disparity.exr")[0][..., 0]
    expected = dual_pixel_disparity(Slab.of(scene.camera, 1, 64), scene.plane(3.0), depth)
    np.testing.assert_allclose(traced, expected, atol=1e-6)
    assert traced.min() < 0 < traced.max()
    lfcore.record(scene, tmp_path / "field.mkv", pixels=64)
    field = str(tmp_path / "field.mkv")
    assert not main(["refocus", field, *lens, "-o", str(tmp_path / "of_file.png")])
    stored = read_exr(tmp_path / "of_file_disparity.exr")[0][..., 0]
    assert stored.shape == traced.shape and (tmp_path / "of_file_right.png").exists()
    assert np.median(np.abs(stored - traced)) < 0.02 * np.ptp(traced)


def test_a_kept_magnification_moves_the_disparity_with_the_picture():
    slab, plane = Slab(CAMERA, 1, 64), SensorPlane(1.5, 1.2, keep_magnification=True)
    larger = plane.magnification(slab)
    depth = np.where(np.arange(64) < 20, 2.0, 9.0) * np.ones((64, 1))
    found = disparity_map(slab, plane, depth)
    edge = np.argmax(np.abs(np.diff(found[32]))) + 1
    assert edge - 32 == pytest.approx((20 - 32) * larger, abs=1) and larger > 1.1
    assert found[32, 0] == dual_pixel_disparity(slab, plane, 2.0)


def test_films_have_no_pairs(tmp_path, capsys):
    file = str(tmp_path / "walk.mp4")
    assert main(["refocus", str(tmp_path / "walk.mkv"), "--dual-pixel", "-o", file])
    assert "--dual-pixel: is for pictures" in capsys.readouterr().err
