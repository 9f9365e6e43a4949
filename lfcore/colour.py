"""Colour between linear light and sRGB (IEC 61966-2-1), for pictures in memory.

The kernels have their own (tracing/kernels), and lfcore.storage.ycbcr goes on from here to the
planes of a video frame.
"""

import math

import numpy as np

from lfcore.errors import OpticsError

PEAK = 255.0
"""Display value of white."""
_PART = 1 << 18
"""The numbers that are converted at a time: they stay in the cache."""


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
    codes = np.asarray(encoded)
    if codes.dtype == np.uint8:
        return _LINEAR_OF_CODE[codes]
    shown = np.clip(floating(codes), 0, 1)
    kind = shown.dtype.type
    curve = ((shown + kind(0.055)) * kind(1 / 1.055)) ** kind(2.4)
    return np.where(shown <= 0.04045, shown * kind(1 / 12.92), curve)


_M1, _M2 = 2610 / 16384, 2523 / 32
_C1, _C2, _C3 = 3424 / 4096, 2413 / 128, 2392 / 128


def pq_encode(light: np.ndarray | float) -> np.ndarray:
    """Codes in [0, 1] by PQ of light over the most that it holds, both clipped; types as above.

    Source: SMPTE ST 2084, equation 5.2, whose most is 10,000 cd/m2.
    """
    share = np.clip(floating(light), 0, 1)
    kind = share.dtype.type
    with np.errstate(under="ignore"):
        power = share ** kind(_M1)
        return ((kind(_C1) + kind(_C2) * power) / (1 + kind(_C3) * power)) ** kind(_M2)


def pq_decode(codes: np.ndarray | float) -> np.ndarray:
    """The inverse of :func:`pq_encode` (SMPTE ST 2084, equation 4.1), in float64 within."""
    given = floating(codes)
    power = np.clip(given, 0, 1).astype(np.float64) ** (1 / _M2)
    share = np.maximum(power - _C1, 0) / (_C2 - _C3 * power)
    return (share ** (1 / _M1)).astype(given.dtype)


def display_values(picture: np.ndarray) -> np.ndarray:
    """float64 sRGB values from 0 to 255, not rounded, of linear light in [0, 1] (clipped).

    Errors of pictures are measured in these, so they are made in float64 whatever comes.
    """
    return PEAK * srgb_encode(np.asarray(picture, np.float64))


def srgb_codes(picture: np.ndarray, bits: int = 8) -> np.ndarray:
    """uint8 or uint16 sRGB codes of linear light in [0, 1] (clipped), rounded once, half to even.

    A part at a time, for float64 takes eight times the memory of codes.
    """
    light = np.asarray(picture)
    codes = np.empty(light.shape, np.uint8 if bits == 8 else np.uint16)
    flat, to = light.reshape(-1), codes.reshape(-1)
    for start in range(0, flat.size, _PART):
        part = slice(start, start + _PART)
        shown = srgb_encode(flat[part].astype(np.float64))
        to[part] = np.rint((2**bits - 1) * shown)
    return codes


def to_uint8(encoded: np.ndarray) -> np.ndarray:
    """uint8 codes of display values in [0, 1] (clipped), rounded."""
    return np.rint(np.clip(encoded, 0, 1) * PEAK).astype(np.uint8)


MOST_EV = 64.0
"""Stops of exposure at most, either way."""
SHOULDER = 0.5
"""Linear light at which the roll-off of highlights begins: 74 % of the display's values."""


def exposed(picture: np.ndarray, exposure_ev: float = 0.0, roll_off: bool = False) -> np.ndarray:
    """Expose linear light for a display, on which 1 is white.

    Parameters
    ----------
    picture : ndarray
        (..., 3) linear light.
    exposure_ev : float
        Stops: 1 doubles the light.
    roll_off : bool
        Compress highlights instead of cutting them at white: where the largest channel m is above
        one half, the colour is scaled so that it is ``1 - 1 / (4 m)``.

    Returns
    -------
    ndarray
        The same shape and type; at most 1 with ``roll_off``.

    Raises
    ------
    OpticsError
        The exposure is not finite, or beyond 64 stops.

    Examples
    --------
    >>> lfcore.exposed(np.array([[0.25, 0.5, 1.0]]), exposure_ev=1).tolist()
    [[0.5, 1.0, 2.0]]
    """
    check_exposure(exposure_ev)
    picture = floating(picture)
    kind = picture.dtype.type
    light = picture * kind(2.0**exposure_ev) if exposure_ev else picture
    if roll_off:
        most = np.maximum(light.max(axis=-1, keepdims=True), kind(SHOULDER))
        light = light * ((1 - kind(SHOULDER**2) / most) / most)
    return light


def check_exposure(exposure_ev: float) -> None:
    """Raise :class:`OpticsError` for stops that are no number up to 64, either way."""
    if not (math.isfinite(exposure_ev) and abs(exposure_ev) <= MOST_EV):
        problem = f"is no number of stops from {-MOST_EV:g} to {MOST_EV:g}: {exposure_ev:g}"
        raise OpticsError(problem, key="exposure_ev", remedy="Give stops, e.g. -1.5")


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
