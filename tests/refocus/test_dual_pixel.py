"""Halves of apertures, as the two pixels under a microlens see them."""

import argparse

import numpy as np
import pytest
from plain_scenes import refused
from test_depth_slicing import CAMERA, everywhere, grey, seen, sliced

from lfcore import OpticsError, SensorPlane, Slab
from lfcore.cli import main
from lfcore.cli.values import aperture
from lfcore.optics.dual_pixel import pair_disparity
from lfcore.optics.ray_cells import displaced_views
from lfcore.refocus.shift_sum import shift_sum_views

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


def test_disparity_is_affine_in_inverse_depth_and_changes_its_sign_in_focus():
    """Of a card at several depths: between the centroids of both pictures."""
    views, plane, pixels = displaced_views(Slab(CAMERA, 4, 96)), SensorPlane(4.0, 1.0), 48
    found, expected = [], []
    for depth in (2.5, 3.3, 4.0, 6.0, 20.0):
        side = 0.1 * depth
        card = (depth, grey(lambda x, y: 0 * x + 1), lambda x, y, h=side: np.hypot(x, y) < h)
        left, right = sliced(views, plane.halves(), pixels, *seen(views, [card]))[..., 0]
        places = [np.average(np.arange(pixels), weights=each.sum(0)) for each in (left, right)]
        found.append(places[1] - places[0])
        expected.append(float(pair_disparity(views.slab, plane, np.array(depth), pixels)))
    np.testing.assert_allclose(found, expected, atol=0.03)
    assert expected[0] < -1 and abs(expected[2]) < 1e-9 and expected[4] > 1


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
def test_the_command_writes_a_pair_beside_its_mean(tmp_path):
    file = tmp_path / "pair.npy"
    assert not main(["render", "example", "--pixels", "16", "--dual-pixel", "-o", str(file)])
    whole, left, right = np.load(file)
    np.testing.assert_allclose((left + right) / 2, whole, atol=1e-6)
    assert np.abs(left - right).max() > 0.01
    assert main(["render", "example", "--aperture", "left", "--dual-pixel", "-o", str(file)])
