"""Planar bytes in and out of FFmpeg's frames, by plain copies: no converter is involved."""

from collections.abc import Iterator
from typing import Any

import av
import numpy as np
from numpy.typing import DTypeLike

from lfcore.storage.pixels import PixelFormat

PACKED_RGB = "bgr0"
"""FFV1 has no planar 8-bit RGB: ``gbrp`` frames pass through it as blue, green, red, 0."""
_GREY_OF = {"yuv420p": "gray", "yuv420p10le": "gray10le"}
"""H.264 of grey alone is decoded with two planes of chroma that say nothing."""


def stored_format(decoded: str | None, *, grey: bool) -> str | None:
    """The pixel format that was stored, of what a decoder gives out; ``grey``: in a grey stream."""
    if grey:
        return _GREY_OF.get(decoded or "", decoded)
    return "gbrp" if decoded == PACKED_RGB else decoded


def video_frames(
    frames: np.ndarray, form: PixelFormat, width: int, height: int
) -> Iterator[av.VideoFrame]:
    """FFmpeg's frames of (F, frame_bytes) uint8; raises :class:`StorageError` for other sizes."""
    planes = form.views(np.ascontiguousarray(frames), width, height)
    for index in range(len(frames)):
        frame = av.VideoFrame(width, height, PACKED_RGB if form.rgb else form.name)
        for target, plane in zip(plane_arrays(frame, form), planes, strict=True):
            target[...] = plane[index]
        yield frame


def plane_arrays(frame: av.VideoFrame, form: PixelFormat) -> list[np.ndarray]:
    """The samples of ``frame`` as writable arrays (h, w) in ``form``'s plane order."""
    if form.rgb:
        plane = frame.planes[0]
        pixels = _array(plane, (frame.height, frame.width, 4), (plane.line_size, 4, 1), np.uint8)
        return [pixels[..., channel] for channel in (1, 0, 2)]
    item = form.dtype.itemsize
    return [
        _array(plane, (plane.height, plane.width), (plane.line_size, item), form.dtype)
        for plane in frame.planes[: 1 if form.grey else 3]
    ]


def _array(plane: Any, shape: tuple, strides: tuple, dtype: DTypeLike) -> np.ndarray:
    return np.ndarray(shape, dtype, buffer=plane, strides=strides)
