"""Colour between linear light and sRGB (IEC 61966-2-1), for pictures in memory.

The kernels have their own (tracing/kernels), and lfcore.storage.ycbcr goes on from here to the
planes of a video frame.
"""

import numpy as np

PEAK = 255.0
"""Display value of white."""


def srgb_encode(linear: np.ndarray | float) -> np.ndarray:
    """Display values of linear light, both in [0, 1] (clipped); float32 is kept, else float64."""
    light = np.clip(floating(linear), 0, 1)
    kind = light.dtype.type
    with np.errstate(under="ignore"):
        power = light ** kind(1 / 2.4)
    curve = power * kind(1.055) - kind(0.055)
    return np.where(light <= 0.0031308, light * kind(12.92), curve)


def srgb_decode(encoded: np.ndarray | float) -> np.ndarray:
    """Linear light of display values, both in [0, 1] (clipped).

    ``encoded`` is float32, kept, uint8 codes, which give float32, or else taken as float64.
    """
    given = np.asarray(encoded)
    if given.dtype == np.uint8:
        return _LINEAR_OF_CODE[given]
    shown = np.clip(floating(given), 0, 1)
    kind = shown.dtype.type
    curve = ((shown + kind(0.055)) * kind(1 / 1.055)) ** kind(2.4)
    return np.where(shown <= 0.04045, shown * kind(1 / 12.92), curve)


def display_values(picture: np.ndarray) -> np.ndarray:
    """float64 sRGB values from 0 to 255, not rounded, of linear light in [0, 1] (clipped).

    Errors of pictures are measured in these, so they are made in float64 whatever comes.
    """
    return PEAK * srgb_encode(np.asarray(picture, np.float64))


def srgb_codes(picture: np.ndarray) -> np.ndarray:
    """uint8 sRGB codes of linear light in [0, 1] (clipped), rounded once, half to even."""
    return np.rint(display_values(picture)).astype(np.uint8)


def to_uint8(encoded: np.ndarray) -> np.ndarray:
    """uint8 codes of display values in [0, 1] (clipped), rounded."""
    return np.rint(np.clip(encoded, 0, 1) * PEAK).astype(np.uint8)


def tonemap(image: np.ndarray) -> np.ndarray:
    """(..., 3) linear light into [0, 1]: Reinhard's global operator, white at the brightest pixel.

    Reinhard et al. 2002, "Photographic Tone Reproduction", equation 4, on luminance (BT.709).
    """
    luminance = image @ np.array([0.2126, 0.7152, 0.0722])
    white = max(float(luminance.max()), 1e-12)
    scale = (1.0 + luminance / white**2) / (1.0 + luminance)
    return image * scale[..., None]


def floating(values: np.ndarray | float) -> np.ndarray:
    values = np.asarray(values)
    return values if values.dtype in (np.float32, np.float64) else values.astype(np.float64)


_LINEAR_OF_CODE = srgb_decode(np.arange(256) / PEAK).astype(np.float32)
