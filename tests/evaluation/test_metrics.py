"""Metrics against hand values, a plain reference, and what must hold for any picture."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lfcore.evaluation.metrics import MetricError, mse, psnr, ssim


def slow_ssim(x, y, peak):
    """Wang's formula, window by window, for one channel."""
    offsets = np.arange(-5, 6)
    line = np.exp(-(offsets**2) / (2 * 1.5**2))
    window = np.outer(line, line) / line.sum() ** 2
    c1, c2 = (0.01 * peak) ** 2, (0.03 * peak) ** 2
    scores = []
    for row in range(5, x.shape[0] - 5):
        for column in range(5, x.shape[1] - 5):
            a = x[row - 5 : row + 6, column - 5 : column + 6]
            b = y[row - 5 : row + 6, column - 5 : column + 6]
            mean_a, mean_b = (window * a).sum(), (window * b).sum()
            var_a, var_b = (window * (a - mean_a) ** 2).sum(), (window * (b - mean_b) ** 2).sum()
            cov = (window * (a - mean_a) * (b - mean_b)).sum()
            scores.append(
                (2 * mean_a * mean_b + c1)
                * (2 * cov + c2)
                / ((mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2))
            )
    return np.mean(scores)


def test_psnr_of_hand_values():
    reference = np.zeros((4, 4, 3))
    # Every code off by 1: MSE = 1, 10 log10(255^2) = 48.1308 dB.
    assert psnr(reference + 1, reference, peak=255) == pytest.approx(48.1308, abs=1e-4)
    # One of 48 values off by 255: MSE = 255^2 / 48, 10 log10(48) = 16.8124 dB.
    one_off = reference.copy()
    one_off[0, 0, 0] = 255
    assert psnr(one_off, reference, peak=255) == pytest.approx(16.8124, abs=1e-4)
    # The same picture in [0, 1].
    assert psnr(one_off / 255, reference, peak=1) == pytest.approx(16.8124, abs=1e-4)


def test_equal_pictures():
    picture = np.random.default_rng(1).uniform(0, 255, (20, 30, 3))
    assert psnr(picture, picture, peak=255) == math.inf
    assert ssim(picture, picture, peak=255) == pytest.approx(1.0, abs=1e-12)


def test_unsigned_bytes_do_not_wrap():
    low, high = np.zeros((11, 11), np.uint8), np.full((11, 11), 255, np.uint8)
    assert mse(low, high) == mse(high, low) == 255**2


@settings(max_examples=15)
@given(seed=st.integers(0, 2**32 - 1), height=st.integers(11, 18), width=st.integers(11, 18))
def test_ssim_against_the_plain_formula(seed, height, width):
    rng = np.random.default_rng(seed)
    x = rng.uniform(0, 255, (height, width, 3))
    y = np.clip(x + rng.normal(0, rng.uniform(1, 60), x.shape), 0, 255)
    channels = [slow_ssim(x[..., c], y[..., c], 255) for c in range(3)]
    assert ssim(x[..., 0], y[..., 0], peak=255) == pytest.approx(channels[0], abs=1e-9)
    assert ssim(x, y, peak=255) == pytest.approx(np.mean(channels), abs=1e-9)


@pytest.mark.parametrize(
    ("image", "reference", "peak", "words"),
    [
        (np.zeros((12, 12)), np.zeros((12, 13)), 255, "do not compare"),
        (np.full((12, 12), np.nan), np.zeros((12, 12)), 255, "not finite"),
        (np.zeros((12, 12)), np.ones((12, 12)), 0, "peak"),
        (np.zeros((0, 12)), np.zeros((0, 12)), 255, "empty"),
        (np.zeros((10, 20)), np.zeros((10, 20)), 255, "at least 11"),
    ],
)
def test_what_does_not_compare_is_refused(image, reference, peak, words):
    with pytest.raises(MetricError, match=words):
        (ssim if "at least" in words else psnr)(image, reference, peak=peak)
