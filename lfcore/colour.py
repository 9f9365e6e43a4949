"""Colour between linear light and sRGB (IEC 61966-2-1)."""

from __future__ import annotations

import numpy as np


def srgb_to_linear(encoded: np.ndarray) -> np.ndarray:
    """sRGB in [0, 1] to linear light, float64 (IEC 61966-2-1)."""
    encoded = np.asarray(encoded, np.float64)
    return np.where(
        encoded <= 0.04045, encoded / 12.92, (np.maximum(encoded, 0) / 1.055 + 0.055 / 1.055) ** 2.4
    )


def linear_to_srgb(linear: np.ndarray) -> np.ndarray:
    """Linear light in [0, 1] to sRGB in [0, 1], float64 (IEC 61966-2-1)."""
    linear = np.asarray(linear, np.float64)
    return np.where(
        linear <= 0.0031308, linear * 12.92, 1.055 * np.maximum(linear, 0) ** (1 / 2.4) - 0.055
    )
