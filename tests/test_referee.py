"""Formulas of the referee's peers in closed form, its lens, and the network that it teaches."""

from itertools import repeat

import numpy as np
import pytest
from scipy.ndimage import convolve

from benchmarks import teach
from benchmarks.peers import convolved
from benchmarks.referee_scenes import BLUR_PX, with_lens
from lfcore.datasets.kinds import blur_px
from tests.plain_scenes import scene, wall

SHARP = np.random.default_rng(3).random((24, 24, 3)).astype(np.float32)
KERNELS = [convolved.disc, convolved.half_disc, convolved.translating_disc, convolved.butterworth]
INNER = np.s_[8:-8, 8:-8]


def true_blur(picture, kernel):
    return np.stack([convolve(picture[..., k], kernel) for k in range(3)], axis=-1)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("method", [convolved.layered, convolved.gathered])
def test_even_depth_is_a_convolution(kernel, method):
    found = method(SHARP, np.full((24, 24), 3.5), kernel)
    assert np.allclose(found[INNER], true_blur(SHARP, kernel(3.5))[INNER], atol=1e-5)


def test_fossas_even_depth_is_a_convolution_by_its_falloff():
    x = np.arange(-4, 5)
    kernel = np.exp(-2 * (np.hypot(x, x[:, None]) / 3.5) ** 4)
    found = convolved.fossa(SHARP, np.full((24, 24), 3.5), power=4)
    assert np.allclose(found[INNER], true_blur(SHARP, kernel / kernel.sum())[INNER], atol=1e-5)


@pytest.mark.parametrize("method", [convolved.layered, convolved.gathered, convolved.fossa])
def test_what_is_in_focus_is_sharp(method):
    assert np.allclose(method(SHARP, np.zeros((24, 24))), SHARP, atol=1e-6)


def test_splats_of_an_even_picture_keep_it():
    grey = np.full((24, 24, 3), 0.25, np.float32)
    assert np.allclose(convolved.splats(grey, np.full((24, 24), 3.0)), 0.25, atol=1e-6)


@pytest.mark.parametrize("radius", [0.0, -3.0])
def test_a_near_splat_covers_by_its_gaussian(radius):
    sharp, radii = np.zeros((24, 24, 3), np.float32), np.full((24, 24), 0.1)
    sharp[12, 12], radii[12, 12] = 1, radius
    variance = convolved.FOOTPRINT + radius**2 / 4
    x = np.exp(-np.square(np.arange(24) - 12) / (2 * variance)) * convolved.FOOTPRINT / variance
    apart = np.abs(convolved.splats(sharp, radii)[12, :, 0] - x)
    apart[12] *= radius == 0  # behind a spread splat there is a hole
    assert apart.max() < 0.01


def test_both_halves_make_the_disc():
    left = convolved.half_disc(5.0)
    assert np.allclose(left + left[:, ::-1], 2 * convolved.disc(5.0), atol=2e-3)


@pytest.mark.parametrize("kernel", KERNELS[1:])
def test_the_left_view_moves_to_the_left_behind_the_focus(kernel):
    columns = kernel(5.0).sum(0), kernel(-5.0).sum(0)
    behind, before = (np.arange(len(sums)) @ sums - len(sums) // 2 for sums in columns)
    assert -5 < behind < -0.5 and before == pytest.approx(-behind)


def test_a_layer_in_front_hides_what_is_sharp_behind():
    """A blurred edge in front covers a sharp wall by half at its middle."""
    sharp, radius = np.zeros((24, 24, 3), np.float32), np.zeros((24, 24))
    sharp[:, 12:], radius[:, 12:] = 1, -4
    seen = convolved.layered(sharp, radius)[12, :, 0]
    assert 0.3 < seen[11] < 0.5 < seen[12] and (np.diff(seen) >= -1e-6).all() and seen[7] == 0


def test_the_lens_blurs_both_ends_equally():
    depth = np.repeat([[1.0, 2.0, 8.0]], 30, axis=0).repeat(10, axis=1)
    camera = with_lens(scene(wall(3.0)), depth).camera
    radius = blur_px(camera, 30, depth, camera.focus_m) / 2
    assert radius[0, [0, -1]].tolist() == pytest.approx([-BLUR_PX, BLUR_PX])


def test_pixels_near_edges_are_those_within_the_distance():
    depth = np.full((5, 40), 2.0)
    depth[:, 20:] = 2 * teach.EDGE + 0.1
    assert np.flatnonzero(teach.near_edges(depth, 4)[2]).tolist() == list(range(16, 23))
    depth[:, 20:] = 2.1
    assert not teach.near_edges(depth, 4).any()


def test_errors_count_dioptres_and_shares_of_depth():
    tested = [{"depth": np.array([[1.0] * 20 + [2.0] * 20 + [np.inf] * 8], np.float16)}]
    (row, *_) = teach.errors_of([np.array([[1.0] * 20 + [0.25] * 28])], tested)
    assert row["AbsRel"] == 0.5 and row["d < 1.25"] == 0.5
    assert row["RMSE, dpt"] == pytest.approx(0.25 / np.sqrt(2))


@pytest.mark.slow
def test_a_network_learns_depth_from_focus():
    """Two planes: the left half is sharp in the first, the right half in the second."""
    torch = pytest.importorskip("torch")
    torch.set_num_threads(1)
    from benchmarks.peers import depth_network

    noise = np.random.default_rng(1).integers(0, 256, (1, 2, 16, 32, 3)).astype(np.uint8)
    dioptres = np.full((1, 16, 32), 0.5, np.float32)
    dioptres[..., :16] = 2
    noise[:, 0, :, 16:] = noise[:, 1, :, :16] = 128
    focus = np.array([2, 0.5], np.float32)
    assert depth_network.sharpness(depth_network.as_input(noise))[0, 0, 0, 8, 8] > 0.9
    network, losses = depth_network.trained(repeat((noise, dioptres)), focus, 20, 1e-2, seed=2)
    found = depth_network.found(network, noise[0], focus)
    assert losses[-1] < losses[0] / 2 and depth_network.weights(network) < 300_000
    assert found[:, :12].mean() > found[:, 20:].mean() + 0.5
