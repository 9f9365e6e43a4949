"""Colour: against the oracle's formulas in float64, and what survives a round trip."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfcore.colour import srgb_decode, srgb_encode, to_uint8
from lfcore.errors import StorageError
from lfcore.evaluation.metrics import psnr
from lfcore.oracle import colour as truth
from lfcore.storage.pixels import pixel_format
from lfcore.storage.ycbcr import frames_from_rgb, rgb_from_frames, rgb_to_ycbcr, ycbcr_to_rgb


def pictures(seed: int, shape=(2, 24, 32, 3)) -> np.ndarray:
    return np.random.default_rng(seed).random(shape).astype(np.float32)


@given(*[st.floats(0, 1) for _ in "rgb"], st.sampled_from([8, 10]))
def test_ycbcr_against_the_formula(red, green, blue, bits):
    expected = truth.ycbcr((red, green, blue), bits)
    for dtype, tolerance in ((np.float64, 1e-9), (np.float32, 1e-3)):
        rgb = np.array([red, green, blue], dtype)
        codes = rgb_to_ycbcr(rgb, bits)
        assert codes.dtype == dtype
        np.testing.assert_allclose(codes, expected, atol=tolerance)
        back = ycbcr_to_rgb(*np.moveaxis(codes, -1, 0), bits, dtype)
        np.testing.assert_allclose(back, rgb, atol=1e-5)


@given(st.floats(0, 1))
def test_srgb_curve(value):
    expected = truth.srgb_encode(value)
    for dtype, tolerance in ((np.float64, 1e-12), (np.float32, 1e-6)):
        encoded = srgb_encode(np.array([value], dtype))
        assert encoded.dtype == dtype and abs(encoded[0] - expected) <= tolerance
        assert abs(srgb_decode(encoded)[0] - value) <= 20 * tolerance


def test_srgb_codes_survive():
    codes = np.arange(256, dtype=np.uint8)
    assert (to_uint8(srgb_encode(srgb_decode(codes))) == codes).all()


@pytest.mark.parametrize("name, least", [
    ("yuv444p", 52), ("yuv444p10le", 63), ("gbrp", 58),
])  # fmt: skip
def test_round_trip_without_a_codec(name, least):
    rgb = pictures(1, (2, 33, 17, 3))
    back = rgb_from_frames(frames_from_rgb(rgb, name), name, 17, 33)
    assert psnr(back, rgb, peak=1) >= least


@pytest.mark.parametrize("name", ["yuv444p10le", "gbrp"])
def test_eight_bit_pictures_survive_losslessly(name):
    rgb = to_uint8(pictures(2))
    assert (to_uint8(rgb_from_frames(frames_from_rgb(rgb, name), name, 32, 24)) == rgb).all()


@pytest.mark.parametrize("name", ["yuv420p", "yuv420p10le"])
def test_chroma_is_the_mean_of_four(name):
    rgb, form = pictures(3), pixel_format(name)
    planes = form.views(frames_from_rgb(rgb, name), 32, 24)
    for f, y, x in ((0, 0, 0), (1, 5, 9), (1, 11, 15)):
        block = rgb[f, 2 * y : 2 * y + 2, 2 * x : 2 * x + 2].reshape(4, 3)
        mean = truth.ycbcr(block, form.bits).mean(0)
        assert abs(float(planes[1][f, y, x]) - mean[1]) <= 0.51
        assert abs(float(planes[2][f, y, x]) - mean[2]) <= 0.51


def test_constant_colour_survives_subsampling():
    rgb = np.full((1, 8, 8, 3), (0.2, 0.5, 0.9), np.float32)
    frames = frames_from_rgb(rgb, "yuv420p10le")
    back = rgb_from_frames(frames, "yuv420p10le", 8, 8)
    np.testing.assert_allclose(back, rgb, atol=2e-3)


def test_linear_chroma_is_sited_in_the_centre():
    """A ramp of colour comes back straight, without a shift, away from the border."""
    ramp = np.linspace(0.2, 0.8, 32, dtype=np.float32)
    rgb = np.full((1, 8, 32, 3), 0.5, np.float32)
    rgb[..., 0] = ramp
    back = rgb_from_frames(frames_from_rgb(rgb, "yuv420p10le"), "yuv420p10le", 32, 8)
    np.testing.assert_allclose(back[0, :, 2:-2, 0], rgb[0, :, 2:-2, 0], atol=2e-3)


def test_padding_repeats_the_border():
    rgb = pictures(4, (1, 5, 5, 3))
    back = rgb_from_frames(frames_from_rgb(rgb, "gbrp", 16, 16), "gbrp", 16, 16)
    np.testing.assert_allclose(back[0, 4:, 4:], np.broadcast_to(back[0, 4, 4], (12, 12, 3)))


def test_misfits_are_refused():
    with pytest.raises(StorageError, match="even"):
        frames_from_rgb(pictures(0, (1, 5, 5, 3)), "yuv420p")
    with pytest.raises(StorageError, match="unknown pixel format"):
        frames_from_rgb(pictures(0), "nv12")
    with pytest.raises(StorageError, match="frames must be"):
        rgb_from_frames(np.zeros((2, 100), np.uint8), "yuv444p", 8, 8)
