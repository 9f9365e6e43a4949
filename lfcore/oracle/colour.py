"""Colour as in the standards, one formula per function, float64.

Sources: IEC 61966-2-1 (sRGB), ITU-R BT.709-6 (luma weights, limited range codes), SMPTE ST 2084
(PQ).
"""

import numpy as np

RED, GREEN, BLUE = 0.2126, 0.7152, 0.0722


def srgb_encode(linear: np.ndarray) -> np.ndarray:
    """Display values of linear light in [0, 1]; any shape, float64."""
    linear = np.asarray(linear, np.float64)
    bright = 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, 12.92 * linear, bright)


def srgb_decode(encoded: np.ndarray) -> np.ndarray:
    """Linear light of display values in [0, 1]; any shape, float64."""
    encoded = np.asarray(encoded, np.float64)
    bright = ((np.maximum(encoded, 0.04045) + 0.055) / 1.055) ** 2.4
    return np.where(encoded <= 0.04045, encoded / 12.92, bright)


def ycbcr(encoded: np.ndarray, bits: int = 8) -> np.ndarray:
    """BT.709 limited-range codes Y, Cb, Cr (..., 3), not rounded, of sRGB-encoded (..., 3)."""
    red, green, blue = np.moveaxis(np.asarray(encoded, np.float64), -1, 0)
    luma = RED * red + GREEN * green + BLUE * blue
    cb = (blue - luma) / (2 * (1 - BLUE))
    cr = (red - luma) / (2 * (1 - RED))
    return np.stack([219 * luma + 16, 224 * cb + 128, 224 * cr + 128], -1) * 2.0 ** (bits - 8)


def pq(light: np.ndarray) -> np.ndarray:
    """PQ codes in [0, 1] of light over its most, in [0, 1] (SMPTE ST 2084, equation 5.2)."""
    power = np.asarray(light, np.float64) ** 0.1593017578125
    return ((0.8359375 + 18.8515625 * power) / (1 + 18.6875 * power)) ** 78.84375
