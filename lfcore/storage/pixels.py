"""Pixel formats: the order of a video frame's samples in memory.

A frame is one contiguous run of bytes, plane after plane, rows without padding.  Formats with more
than 8 bits have little-endian 16-bit samples.  YCbCr is BT.709, limited ("tv") range, made from
encoded RGB (sRGB, or PQ); ``gbrp`` is sRGB-encoded RGB itself, planes in the order green, blue,
red.  Grey formats have one plane of codes, not necessarily of light.
"""

import math
from dataclasses import dataclass

import numpy as np

from lfcore.errors import StorageError, check_known


@dataclass(frozen=True)
class PixelFormat:
    """A pixel format.

    Attributes
    ----------
    name : str
        FFmpeg's name.
    bits : int
        Bits per sample.
    subsampling : int
        2 for 4:2:0, else 1.
    rgb, grey : bool
        Whether the planes are RGB instead of YCbCr; whether there is only one plane.
    """

    name: str
    bits: int
    subsampling: int
    rgb: bool = False
    grey: bool = False

    @property
    def dtype(self) -> np.dtype:
        """The type of a sample: uint8, or little-endian uint16."""
        return np.dtype(np.uint8) if self.bits == 8 else np.dtype("<u2")

    @property
    def black(self) -> tuple[int, ...]:
        """The code of black in each plane."""
        scale = 1 << (self.bits - 8)
        if self.grey:
            return (0,)
        return (0, 0, 0) if self.rgb else (16 * scale, 128 * scale, 128 * scale)

    def planes(self, width: int, height: int) -> list[tuple[int, int]]:
        """Return the rows and columns of each plane; :class:`StorageError` for impossible sizes."""
        if width < 1 or height < 1 or width % self.subsampling or height % self.subsampling:
            problem = f"a frame of {width} x {height} cannot be {self.name}"
            remedy = "Use positive and, for 4:2:0, even sizes"
            raise StorageError(problem, key="pixel_format", remedy=remedy)
        small = height // self.subsampling, width // self.subsampling
        return [(height, width)] + [small, small] * (not self.grey)

    def frame_bytes(self, width: int, height: int) -> int:
        """Return the bytes of one frame."""
        return sum(map(math.prod, self.planes(width, height))) * self.dtype.itemsize

    def views(self, frames: np.ndarray, width: int, height: int) -> list[np.ndarray]:
        """Return the planes of ``frames`` (F, frame_bytes) uint8 as views (F, h, w)."""
        expected = self.frame_bytes(width, height)
        if frames.dtype != np.uint8 or frames.ndim != 2 or frames.shape[1] != expected:
            raise StorageError(
                f"frames must be uint8 (F, {expected}) for {self.name} {width} x {height}, "
                f"not {frames.dtype} {frames.shape}"
            )
        shapes = self.planes(width, height)
        samples, ends = frames.view(self.dtype), np.cumsum([math.prod(shape) for shape in shapes])
        parts = np.split(samples, ends[:-1], axis=1)
        return [
            part.reshape(len(frames), *shape) for part, shape in zip(parts, shapes, strict=True)
        ]


PIXEL_FORMATS = {
    known.name: known
    for known in (
        PixelFormat("yuv420p", 8, 2),
        PixelFormat("yuv444p", 8, 1),
        PixelFormat("yuv420p10le", 10, 2),
        PixelFormat("yuv444p10le", 10, 1),
        PixelFormat("yuv420p12le", 12, 2),
        PixelFormat("yuv444p12le", 12, 1),
        PixelFormat("gbrp", 8, 1, rgb=True),
    )
}
"""The formats of colours."""
GREY_FORMATS = {
    known.name: known
    for known in (PixelFormat("gray", 8, 1, grey=True), PixelFormat("gray10le", 10, 1, grey=True))
}
"""The formats with one plane of codes."""


def pixel_format(name: str) -> PixelFormat:
    """Return the format of a name, colour or grey; :class:`StorageError` if it is unknown."""
    formats = PIXEL_FORMATS | GREY_FORMATS
    check_known(StorageError, "pixel_format", name, formats, "pixel format")
    return formats[name]
