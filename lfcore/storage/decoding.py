"""Frames decoded from packets, and copies between FFmpeg's frames and planar bytes, without
FFmpeg's converter."""

from collections.abc import Iterable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.error import FFmpegError
from numpy.typing import DTypeLike

from lfcore.errors import StorageError
from lfcore.storage.pixels import PixelFormat

FRAME_RATE = 25
"""The frames per second.  Their 40 ms are exact in Matroska's milliseconds; time has no other
meaning here."""
PACKED_RGB = "bgr0"
"""FFmpeg's format of 8-bit RGB in FFV1, which has no planar one: bytes blue, green, red, 0."""
_GREY_OF = {"yuv420p": "gray", "yuv420p10le": "gray10le"}
"""The grey format of a decoder's format: H.264 decodes grey with two constant chroma planes."""


def ticks_per_frame(time_base: Fraction | None) -> int:
    """Return the units of ``time_base`` per frame; 0 if this is no whole number."""
    if not time_base:
        return 0
    ticks = 1 / (time_base * FRAME_RATE)
    return ticks.numerator if ticks.denominator == 1 else 0


def frame_number(pts: int | None, ticks: int) -> int | None:
    """Return the number of the frame shown at ``pts``; None if it is unknown or not whole."""
    if pts is None or not ticks:
        return None
    number, rest = divmod(pts, ticks)
    return None if rest else number


def decoded_planes(
    file: Path,
    context: av.VideoCodecContext,
    packets: Iterable[av.Packet],
    ticks: int,
    form: PixelFormat,
    size: tuple[int, int],
) -> Iterator[tuple[int, list[np.ndarray]]]:
    """Yield each frame's number and planes (h, w), in the decoder's memory.

    ``ticks`` is the duration of a frame.  Raises :class:`StorageError` that names ``file`` if a
    frame cannot be decoded, has another format or size (width, height), or has no number.
    """
    for frame in _decoded(file, context, packets):
        name = stored_format(frame.format.name, grey=form.grey)
        actual, expected = (frame.width, frame.height, name), (*size, form.name)
        if actual != expected:
            problem = "frames are {} x {} {}, not {} x {} {} as in the metadata"
            raise StorageError(problem.format(*actual, *expected), file=file)
        number = frame_number(frame.pts, ticks)
        if number is None:
            raise StorageError("a frame has no number", file=file)
        yield number, plane_arrays(frame, form)


def _decoded(
    file: Path, context: av.VideoCodecContext, packets: Iterable[av.Packet]
) -> Iterator[av.VideoFrame]:
    try:
        for packet in packets:
            yield from context.decode(packet)
        yield from context.decode(None)
    except FFmpegError as error:
        problem = f"the video cannot be decoded: {error.strerror or error}"
        raise StorageError(problem, file=file) from error


def packed(
    frames: Iterable[list[np.ndarray]],
    count: int,
    form: PixelFormat,
    size: tuple[int, int],
    chunk: int,
    rooms: Iterator[np.ndarray] | None = None,
) -> Iterator[np.ndarray]:
    """Pack the planes of ``count`` frames into arrays (up to ``chunk``, frame_bytes) uint8.

    ``rooms`` are the arrays to fill, one after another; default: new ones.
    """
    filled = 0
    for done, planes in enumerate(frames):
        if not filled:
            shape = min(chunk, count - done), form.frame_bytes(*size)
            out = next(rooms)[: shape[0]] if rooms else np.empty(shape, np.uint8)
            targets = form.views(out, *size)
        for target, plane in zip(targets, planes, strict=True):
            target[filled] = plane
        filled += 1
        if filled == len(out):
            yield out
            filled = 0


def stored_format(decoded: str | None, *, grey: bool) -> str | None:
    """Return the stored pixel format of a decoder's format; ``grey``: in a grey stream."""
    if grey:
        return _GREY_OF.get(decoded or "", decoded)
    return "gbrp" if decoded == PACKED_RGB else decoded


def video_frames(
    frames: np.ndarray, form: PixelFormat, width: int, height: int
) -> Iterator[av.VideoFrame]:
    """Convert (F, frame_bytes) uint8 to FFmpeg's frames; :class:`StorageError` for other sizes."""
    planes = form.views(np.ascontiguousarray(frames), width, height)
    for index in range(len(frames)):
        frame = av.VideoFrame(width, height, PACKED_RGB if form.rgb else form.name)
        for target, plane in zip(plane_arrays(frame, form), planes, strict=True):
            target[...] = plane[index]
        yield frame


def plane_arrays(frame: av.VideoFrame, form: PixelFormat) -> list[np.ndarray]:
    """Return the samples of ``frame`` as writable arrays (h, w) in ``form``'s plane order."""
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
