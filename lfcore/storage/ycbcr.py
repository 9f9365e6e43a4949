"""sRGB-encoded pictures to the planes of a video frame, and back.

Light is averaged linearly and stored sRGB-encoded (lfcore.colour).  YCbCr is ITU-R BT.709, limited
range: for b bits, luma codes are from 16 to 235 and chroma codes from 16 to 240, times
``2^(b - 8)``.  Conversions use floats and round once, half to even.  4:2:0 chroma is the mean of
2 x 2 pixels, so its samples are at their centre; a tag of the stream records this.
"""

import numpy as np

from lfcore.colour import floating
from lfcore.storage.pixels import PixelFormat, pixel_format

RED = 0.2126
"""The weight of red in BT.709's luma."""
BLUE = 0.0722
"""The weight of blue in BT.709's luma."""
GREEN = 1.0 - RED - BLUE
"""The weight of green in BT.709's luma."""
BAND_PIXELS = 1 << 18
"""The pixels that are converted at a time: intermediate results fit a cache."""


def rgb_to_ycbcr(rgb: np.ndarray, bits: int = 8) -> np.ndarray:
    """Convert sRGB-encoded ``rgb`` (..., 3) in [0, 1] to unrounded codes (..., 3) Y, Cb, Cr.

    The type, float32 or float64, is kept.  BT.709: ``Y' = Kr R + Kg G + Kb B``,
    ``Cb = (B - Y') / (2 - 2 Kb)``, ``Cr = (R - Y') / (2 - 2 Kr)``; limited range
    ``16 + 219 Y'``, ``128 + 224 C``.
    """
    rgb = floating(rgb)
    kind, scale = rgb.dtype.type, float(1 << (bits - 8))
    red, green, blue = rgb[..., 0], rgb[..., 1], rgb[..., 2]
    luma = kind(RED) * red + kind(GREEN) * green + kind(BLUE) * blue
    out = np.empty_like(rgb)
    out[..., 0] = kind(16 * scale) + kind(219 * scale) * luma
    out[..., 1] = kind(128 * scale) + kind(112 * scale / (1 - BLUE)) * (blue - luma)
    out[..., 2] = kind(128 * scale) + kind(112 * scale / (1 - RED)) * (red - luma)
    return out


def ycbcr_to_rgb(
    luma: np.ndarray, blue: np.ndarray, red: np.ndarray, bits: int, dtype: type = np.float32
) -> np.ndarray:
    """Convert arrays of codes to sRGB-encoded RGB (..., 3), clipped to [0, 1]; float32 or
    float64."""
    scale = float(1 << (bits - 8))
    luma = (luma.astype(dtype) - dtype(16 * scale)) * dtype(1 / (219 * scale))
    cb = (blue.astype(dtype) - dtype(128 * scale)) * dtype(1 / (112 * scale))
    cr = (red.astype(dtype) - dtype(128 * scale)) * dtype(1 / (112 * scale))
    rgb: np.ndarray = np.empty((*luma.shape, 3), dtype)
    np.add(luma, dtype(1 - RED) * cr, out=rgb[..., 0])
    np.add(luma, dtype(1 - BLUE) * cb, out=rgb[..., 2])
    green = luma - dtype(BLUE * (1 - BLUE) / GREEN) * cb
    np.subtract(green, dtype(RED * (1 - RED) / GREEN) * cr, out=rgb[..., 1])
    return np.clip(rgb, 0, 1, out=rgb)


def frames_from_rgb(
    rgb: np.ndarray, format_name: str, width: int | None = None, height: int | None = None
) -> np.ndarray:
    """Convert sRGB-encoded pictures (F, h, w, 3), uint8 or floats in [0, 1], to planar frames
    (F, frame_bytes) uint8; larger frames repeat the last column and row."""
    form = pixel_format(format_name)
    count, high, wide, _ = rgb.shape
    width, height = width or wide, height or high
    if (width, height) != (wide, high):
        rgb = np.pad(rgb, ((0, 0), (0, height - high), (0, width - wide), (0, 0)), mode="edge")
    out = np.empty((count, form.frame_bytes(width, height)), np.uint8)
    planes = form.views(out, width, height)
    # An even number of rows at a time fits a cache; whole pictures take 1.3 to 1.5 times as long.
    step = max(2, BAND_PIXELS // (count * width) // 2 * 2)
    for top in range(0, height, step):
        rows = slice(top, min(top + step, height))
        small = slice(rows.start // form.subsampling, rows.stop // form.subsampling)
        _fill(
            [plane[:, part] for plane, part in zip(planes, (rows, small, small), strict=True)],
            rgb[:, rows],
            form,
        )
    return out


def _fill(planes: list[np.ndarray], rgb: np.ndarray, form: PixelFormat) -> None:
    """Write encoded ``rgb`` (F, h, w, 3) to planes (F, h, w)."""
    if form.rgb:
        codes = rgb if rgb.dtype == np.uint8 else np.rint(np.clip(rgb, 0, 1) * 255)
        for plane, channel in zip(planes, (1, 2, 0), strict=True):
            plane[...] = codes[..., channel]
        return
    if rgb.dtype == np.uint8:
        rgb = rgb.astype(np.float32) * np.float32(1 / 255)
    codes = rgb_to_ycbcr(rgb, form.bits)
    planes[0][...] = np.rint(codes[..., 0])
    for index in (1, 2):
        chroma = codes[..., index]
        if form.subsampling == 2:
            count, height, width = chroma.shape
            chroma = chroma.reshape(count, height // 2, 2, width // 2, 2).mean((2, 4))
        planes[index][...] = np.rint(chroma)


def rgb_from_frames(frames: np.ndarray, format_name: str, width: int, height: int) -> np.ndarray:
    """Convert planar frames to sRGB-encoded pictures (F, height, width, 3) float32 in [0, 1].

    4:2:0 chroma is interpolated between sample centres.
    """
    form = pixel_format(format_name)
    return rgb_from_planes(form.views(frames, width, height), form)


def rgb_from_planes(planes: list[np.ndarray], form: PixelFormat) -> np.ndarray:
    """Convert as :func:`rgb_from_frames` three planes (F, h, w), or windows of planes."""
    if form.rgb:
        green, blue, red = planes
        return np.stack([red, green, blue], -1).astype(np.float32) * np.float32(1 / 255)
    luma, *chroma = planes
    blue, red = (_upsampled(plane, form) for plane in chroma)
    return ycbcr_to_rgb(luma, blue, red, form.bits)


def _upsampled(chroma: np.ndarray, form: PixelFormat) -> np.ndarray:
    """Interpolate chroma (F, h, w), centre-sited, on the grid of luma."""
    if form.subsampling == 1:
        return chroma
    chroma = chroma.astype(np.float32)
    for axis in (1, 2):
        size = chroma.shape[axis]
        before = chroma.take(np.maximum(np.arange(size) - 1, 0), axis)
        after = chroma.take(np.minimum(np.arange(size) + 1, size - 1), axis)
        near = np.float32(0.75) * chroma
        pair = np.stack(
            [near + np.float32(0.25) * before, near + np.float32(0.25) * after], axis + 1
        )
        shape = list(chroma.shape)
        shape[axis] *= 2
        chroma = pair.reshape(shape)
    return chroma
