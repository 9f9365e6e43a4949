"""One segment: the closed-GOP video of one tile, as an MP4 file of its own.

Frames carry exact ticks (one frame is one tick of 1/25 s), so that frame numbers survive any
container.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, cast

import av
import numpy as np
from av.error import FFmpegError

from lfcore.errors import StorageError
from lfcore.files import cannot_write, whole_file
from lfcore.storage.codecs import Encoding
from lfcore.storage.decoding import (
    FRAME_RATE,
    PACKED_RGB,
    frame_number,
    stored_format,
    ticks_per_frame,
    video_frames,
)
from lfcore.storage.pixels import pixel_format
from lfcore.storage.remote import RemoteFile

BT709 = 1
"""The code point of BT.709 primaries and matrix (ITU-T H.273)."""
RGB_MATRIX = 0
"""The code point of RGB without a matrix (ITU-T H.273)."""
TRANSFER_TAGS = {"srgb": 13, "pq": 16}
"""The code points of transfer functions (ITU-T H.273); sRGB is IEC 61966-2-1."""
LIMITED = 1
"""FFmpeg's code of the limited range."""
FULL = 2
"""FFmpeg's code of the full range."""
FEW_FRAMES = 2
"""The most frames that are never reordered.  x265 leaves their decoding times unset; the muxer then
refused half of the files, and the others differed between runs."""


class SegmentWriter:
    """Encodes frames into the file ``path``, which appears when the ``with`` block ends well.

        with SegmentWriter("tile.mp4", spec, width, height) as writer:
            writer.write(frames)  # uint8 (F, frame_bytes), as often as needed

    Raises :class:`StorageError` if frames do not fit, are too small for the encoder or are missing,
    if the encoder refuses its settings, or if the file cannot be written; no file is left then.
    """

    def __init__(self, path: str | Path, spec: Encoding, width: int, height: int):
        spec.check_frame(width, height)
        self.path, self.spec = Path(path), spec
        self.width, self.height = width, height
        self.frames = 0
        self._form = pixel_format(spec.stored_format)

    def __enter__(self) -> SegmentWriter:
        with ExitStack() as scope:
            file = scope.enter_context(whole_file(self.path))
            with self._named_errors():
                self._output = av.open(file, "w", format="mp4")
                scope.push(self._close)
                stream = self._output.add_stream(
                    self.spec.codec, FRAME_RATE, width=self.width, height=self.height
                )
                self._stream = cast(av.VideoStream, stream)
                self._configure(self._stream.codec_context)
                self._output.start_encoding()
            self._scope = scope.pop_all()
        return self

    def _configure(self, context: av.VideoCodecContext) -> None:
        form, options = self._form, self.spec.options(self.width)
        context.pix_fmt = PACKED_RGB if form.rgb else form.name
        context.time_base = Fraction(1, FRAME_RATE)
        context.thread_count = self.spec.threads
        context.gop_size = self.spec.gop or 1 << 20
        if not form.grey:  # the codes of grey formats are no colours
            context.color_primaries = BT709
            context.color_trc = TRANSFER_TAGS[self.spec.transfer or "srgb"]
            context.colorspace = RGB_MATRIX if form.rgb else BT709
            context.color_range = FULL if form.rgb else LIMITED
        if form.subsampling == 2:
            options["chroma_sample_location"] = "center"
        context.options = options

    def _named_errors(self) -> AbstractContextManager[None]:
        return named_errors(self.path, f"encoding with {self.spec.codec}")

    def write(self, frames: np.ndarray) -> None:
        """Encode ``frames`` (F, frame_bytes) uint8; the array may be overwritten afterwards."""
        encode, mux = self._stream.codec_context.encode, self._output.mux_one
        with self._named_errors():
            for frame in video_frames(frames, self._form, self.width, self.height):
                frame.pts = self.frames
                for packet in encode(frame):
                    packet.stream = self._stream
                    mux(packet)
                self.frames += 1

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        with self._scope:
            if error:
                raise error
            if not self.frames:
                raise StorageError("the segment has no frames", file=self.path)
            with self._named_errors():
                for packet in self._stream.codec_context.encode(None):
                    packet.stream = self._stream
                    if self.spec.codec == "libx265" and self.frames <= FEW_FRAMES:
                        packet.dts = packet.pts
                    self._output.mux_one(packet)

    def _close(self, kind: object, error: BaseException | None, trace: object) -> None:
        """Close the container; what then fails hides no earlier error."""
        with suppress(FFmpegError, OSError) if error else self._named_errors():
            self._output.close()


@contextmanager
def named_errors(path: Path, action: str) -> Iterator[None]:
    """Turn errors of the system and of FFmpeg into :class:`StorageError` with the file's name.

    ``action`` is for the message, e.g. "encoding with libx264".
    """
    try:
        yield
    except FFmpegError as error:
        raise StorageError(f"{action} failed: {error.strerror or error}", file=path) from error
    except OSError as error:
        raise cannot_write(path, error) from error


@dataclass(frozen=True)
class SegmentInfo:
    """The content of a segment file.

    Attributes
    ----------
    codec, pixel_format, width, height, frames
        The format, size and number of its frames.
    bytes, crc32 : int
        The size and check sum of its packets, in file order.
    reorder : int
        The most frames by which a frame is decoded before it is shown.
    """

    codec: str
    pixel_format: str
    width: int
    height: int
    frames: int
    bytes: int
    crc32: int
    reorder: int


def read_segment(path: Path, *, grey: bool = False) -> tuple[SegmentInfo, bytes]:
    """Read a segment's content, without decoding it, and the codec's global header.

    ``grey``: frames have one plane of codes.
    """
    again = "Encode this tile again"
    if not _is_whole(path):
        raise StorageError("is cut short, or is no segment", file=path, remedy=again)
    with open_video(path, formats=True) as container:
        video = container.streams.video[0]
        context, ticks = video.codec_context, ticks_per_frame(video.time_base)
        if context.pix_fmt is None:
            problem = "is damaged: its first frame cannot be decoded"
            raise StorageError(problem, file=path, remedy=again)
        form = pixel_format(stored_format(context.pix_fmt, grey=grey) or "")
        frames = size = crc = reorder = 0
        for packet in container.demux(video):
            if not packet.size:
                continue
            number = frame_number(packet.pts, ticks)
            if number is None or (frames == 0 and not packet.is_keyframe):
                raise StorageError("does not begin with a key frame", file=path)
            reorder = max(reorder, frames - number)
            crc = zlib.crc32(packet, crc)
            frames, size = frames + 1, size + packet.size
        codec, picture = context.codec.canonical_name, (context.width, context.height)
        info = SegmentInfo(codec, form.name, *picture, frames, size, crc, reorder)
        return info, context.extradata or b""


def open_video(path: Path, most: int = 1, *, formats: bool = False) -> av.container.InputContainer:
    """Open ``path`` by FFmpeg, with one video stream or up to ``most``; ``formats``: decode a frame
    of each for its pixel format and colours."""
    try:
        # By default FFmpeg reads many frames to find their rate: megabytes of a remote file.
        file: Any = str(path)
        own: Any = None if formats else [{"skip_frame": "all"}] * most
        size, options = 32768, {"analyzeduration": "1"}
        if isinstance(path, RemoteFile):
            file, size = path.open(), 4096  # RemoteFile reads ahead itself
            options["probesize"] = "4096"
        # A damaged tag may be no text; the digest of the metadata detects this.
        container = av.open(
            file, "r", options=options, stream_options=own, metadata_errors="replace",
            buffer_size=size,
        )  # fmt: skip
    except FileNotFoundError:
        raise StorageError("no such file", file=path) from None
    except (FFmpegError, OSError, ValueError) as error:
        # PyAV raises ValueError for files that look like MPEG, whose streams appear late.
        reason = getattr(error, "strerror", "it has another format") or error
        problem = f"cannot be opened as a video: {reason}"
        remedy = "Give a light field file (.mkv), as 'lfcore record' writes it, in full"
        raise StorageError(problem, file=path, remedy=remedy) from error
    streams = container.streams.video
    if not 1 <= len(streams) <= most:
        container.close()
        raise StorageError(f"has {len(streams)} video streams, not one", file=path)
    if any(stream.codec_context is None for stream in streams):
        container.close()
        raise StorageError("has a video with an unknown codec", file=path)
    return container


def _is_whole(path: Path) -> bool:
    """Return whether the boxes of an MP4 file (ISO/IEC 14496-12) fill it; FFmpeg does not check."""
    try:
        size, position = path.stat().st_size, 0
        with open(path, "rb") as file:
            while 0 <= position < size:
                file.seek(position)
                head = file.read(16)
                length = int.from_bytes(head[:4], "big")
                if length == 1:
                    length = int.from_bytes(head[8:16], "big")
                if length < 8:
                    return False
                position += length
    except FileNotFoundError:
        raise StorageError("no such file", file=path) from None
    except OSError as error:
        raise StorageError(f"cannot be read: {error.strerror or error}", file=path) from error
    return position == size > 0
