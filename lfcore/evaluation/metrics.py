"""The error of a picture against its reference: PSNR and SSIM.

Convention of all published tables: pictures are sRGB-encoded, on the scale of 8-bit codes
(``peak=255``), but not rounded to codes -- rounding two pictures alone would cap PSNR at
56 dB.  The mean squared error is pooled over pixels and channels; a table's figure is the mean
of the decibels of its planes.
"""

import math
from collections.abc import Iterable

import numpy as np

from lfcore.colour import display_values
from lfcore.errors import LfcoreError

PEAK = 255
"""White, in 8-bit codes."""
SSIM_SIGMA = 1.5
"""The standard deviation of the Gaussian window, pixels."""
SSIM_WINDOW = 11
"""Pixels per side of the Gaussian window, which scikit-image cuts off at 3.5 sigma."""


class MetricError(LfcoreError):
    """Pictures that cannot be compared."""


def mse(image: np.ndarray, reference: np.ndarray) -> float:
    """Mean squared error of arrays of any dtype, pooled over pixels and channels, in float64.

    Raises :class:`MetricError` when the shapes differ or a value is not finite.
    """
    image, reference = _pair(image, reference)
    return float(np.mean(np.square(image - reference)))


def psnr(image: np.ndarray, reference: np.ndarray, *, peak: float) -> float:
    """Peak signal-to-noise ratio in dB, ``10 log10(peak^2 / MSE)``; ``inf`` for equal pictures.

    ``peak`` is white on the scale of the pictures: 255 or 1.  Raises :class:`MetricError` as
    :func:`mse`.
    """
    return decibels(mse(image, reference), peak=peak)


def decibels(mean_square: float, *, peak: float) -> float:
    """The PSNR of a mean squared error."""
    return math.inf if mean_square == 0 else 10.0 * math.log10(peak**2 / mean_square)


def ssim(image: np.ndarray, reference: np.ndarray, *, peak: float) -> float:
    """Mean structural similarity, averaged over channels.

    Gaussian window of 11 x 11 and sigma 1.5, K1 = 0.01, K2 = 0.03, population covariance;
    windows that leave the picture are not counted.  Pictures are (H, W) or (H, W, C), H and W at
    least 11; ``peak`` and errors are as for :func:`psnr`.  Source: Z. Wang et al., "Image quality
    assessment: from error visibility to structural similarity", IEEE TIP 13(4), 2004.
    """
    from skimage.metrics import structural_similarity  # slow to import

    image, reference = _pair(image, reference)
    if image.ndim not in (2, 3) or min(image.shape[:2]) < SSIM_WINDOW:
        raise MetricError(
            f"SSIM needs pictures of at least {SSIM_WINDOW} x {SSIM_WINDOW}, not {image.shape}"
        )
    score = structural_similarity(
        image, reference, data_range=peak, channel_axis=-1 if image.ndim == 3 else None,
        gaussian_weights=True, sigma=SSIM_SIGMA, use_sample_covariance=False,
    )  # fmt: skip
    return float(score)


def picture_quality(
    pictures: Iterable[np.ndarray], references: Iterable[np.ndarray]
) -> dict[str, float]:
    """``psnr_db`` and ``ssim`` of P pictures (H, W, 3) in linear light, by the convention above;
    means over them."""
    pairs = [tuple(map(display_values, pair)) for pair in zip(pictures, references, strict=True)]
    return {
        "psnr_db": float(np.mean([psnr(*pair, peak=PEAK) for pair in pairs])),
        "ssim": float(np.mean([ssim(*pair, peak=PEAK) for pair in pairs])),
    }


def _pair(image: np.ndarray, reference: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    image, reference = np.asarray(image, np.float64), np.asarray(reference, np.float64)
    if image.shape != reference.shape:
        raise MetricError(f"pictures of shapes {image.shape} and {reference.shape} do not compare")
    if not (np.isfinite(image).all() and np.isfinite(reference).all()):
        raise MetricError("a picture has values that are not finite")
    return image, reference
