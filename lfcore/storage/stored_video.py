"""One video stream of a light field file, colours or inverse depths, decoded by segments.

A segment's check sum is tested before it is decoded.
"""

import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.error import FFmpegError

from lfcore.errors import StorageError
from lfcore.storage.decoding import decoded_planes, frame_number, packed, ticks_per_frame
from lfcore.storage.index import Segment
from lfcore.storage.layout import FrameLayout
from lfcore.storage.metadata import Metadata
from lfcore.storage.segment import open_video

STREAMS = "", " of the depths", " of the specular light", " of the virtual depths"
"""The video streams of a file, as errors name them; the last two or three may be missing."""
MOST_STREAMS = len(STREAMS)
"""The most video streams of a file."""


class StoredVideo:
    """The segments of one video stream.

    Parameters
    ----------
    path : Path
        The file, or a :class:`RemoteFile`.
    metadata : Metadata
        The stream's metadata; for depths those of :meth:`Metadata.of_depth`.
    keys : list of int
        The numbers of all key frames.
    threads : int
        Threads of a decoder.
    track : int
        The stream's number among the file's videos.

    Attributes
    ----------
    keys : list of int
        The numbers of all key frames.
    decoded_frames : int
        The number of frames decoded so far, including those before a requested one.
    decoded_segments : set of int
        The numbers of decoded segments.
    """

    def __init__(
        self, path: Path, metadata: Metadata, keys: list[int], threads: int, track: int = 0
    ):
        self.path, self.metadata, self.threads = path, metadata, threads
        self._track, self.keys = track, keys
        self.decoded_frames = 0
        self.decoded_segments: set[int] = set()
        self._checked: dict[int, np.ndarray] = {}  # the check sums of a segment's packets
        self._idle: list[av.container.InputContainer] = []

    def __repr__(self) -> str:
        segments = len(self.metadata.segments)
        return f"<{type(self).__name__} of {str(self.path)!r}: {segments} segments>"

    @property
    def layout(self) -> FrameLayout:
        """The positions of rays in frames."""
        return self.metadata.layout

    @property
    def segments(self) -> Sequence[Segment]:
        """All segments of the stream."""
        return self.metadata.segments

    def check_segment(self, index: int) -> None:
        """Read a segment without decoding it, and compare its packets with the index.

        Raises :class:`StorageError` if packets are missing, displaced or changed.
        """
        part = self.metadata.segments[index]
        frames = size = crc = 0
        crc_of: dict[int, int] = {}  # frame number: check sum of its packet
        with self._reader(part, part.first) as (_, ticks, packets):
            for packet in packets:
                crc, size, frames = zlib.crc32(packet, crc), size + packet.size, frames + 1
                crc_of[packet.pts // ticks] = zlib.crc32(packet)
        if (frames, size, crc) != (part.frames, part.bytes, part.crc32):
            if frames != part.frames:
                problem = f"has {frames} of its {part.frames} frames"
            else:
                problem = "is damaged: its check sum differs"
            raise self._bad_segment(part, problem)
        self._checked[index] = np.array([crc_of.get(n, 0) for n in range(part.first, part.stop)])

    def check_once(self, index: int) -> None:
        """Call :meth:`check_segment` unless the segment was checked before."""
        if index not in self._checked:
            self.check_segment(index)

    def frames(
        self,
        segment: int,
        start: int = 0,
        stop: int | None = None,
        *,
        chunk: int = 64,
        rooms: Iterator[np.ndarray] | None = None,
    ) -> Iterator[np.ndarray]:
        """Decode frames of a segment, from the last key frame at or before the first.

        Parameters
        ----------
        segment : int
            The segment's number.
        start, stop : int
            The first frame, and the one after the last.
        chunk : int
            The most frames of an array.
        rooms : iterator of ndarray, optional
            (``chunk`` or more, frame_bytes) uint8 arrays to fill, one after another.  Default:
            fresh ones.

        Yields
        ------
        ndarray
            (up to ``chunk``, frame_bytes) uint8.

        Raises
        ------
        StorageError
            The segment is damaged; raised before any frame.
        """
        _, last = self._span(segment, start, stop)
        layout, planes = self.layout, self.planes(segment, start, last)
        size = layout.frame_width, layout.frame_height
        yield from packed(planes, last - start, layout.format, size, chunk, rooms)

    def planes(
        self, segment: int, start: int = 0, stop: int | None = None
    ) -> Iterator[list[np.ndarray]]:
        """Decode as :meth:`frames`, one by one without a copy: planes (h, w) in the decoder's
        memory."""
        part, stop = self._span(segment, start, stop)
        if (next_frame := start) == stop:
            return
        self.decoded_segments.add(segment)
        layout = self.layout
        size = layout.frame_width, layout.frame_height
        with self._reader(part, part.first + start) as (context, ticks, packets):
            checked = self._as_checked(part, packets, ticks)
            decoded = decoded_planes(self.path, context, checked, ticks, layout.format, size)
            for number, planes in decoded:
                self.decoded_frames += 1
                if number - part.first > next_frame:
                    break
                if number - part.first == next_frame:
                    yield planes
                    next_frame += 1
                    if next_frame == stop:
                        return
            problem = f"frame {next_frame} of {start} to {stop - 1} is missing from the stream"
            raise StorageError(problem, file=self.path)

    def _span(self, segment: int, start: int, stop: int | None) -> tuple[Segment, int]:
        """Check a segment; return it, and the frame after the last that is wanted."""
        if not 0 <= segment < len(self.metadata.segments):
            raise StorageError(f"there is no segment {segment}", file=self.path)
        part = self.metadata.segments[segment]
        stop = part.frames if stop is None else stop
        if not 0 <= start <= stop <= part.frames:
            problem = f"frames {start} to {stop} are not within {part.frames} frames"
            raise StorageError(problem, file=self.path)
        self.check_once(segment)
        return part, stop

    def _as_checked(self, part: Segment, packets: Iterable[Any], ticks: int) -> Iterator[Any]:
        """Yield packets while each is the one that :meth:`check_segment` read under its number.

        In a damaged file two packets may have one number; a reader's start decides which it meets.
        """
        crcs, first = self._checked[part.index], True
        for packet in packets:
            if zlib.crc32(packet) != crcs[packet.pts // ticks - part.first]:
                raise self._bad_segment(part, "has two packets with one number")
            if first and not packet.is_keyframe:
                raise self._bad_segment(part, "does not begin with a key frame")
            first = False
            yield packet

    @contextmanager
    def _reader(self, part: Segment, first: int) -> Iterator[tuple[Any, int, Iterator[Any]]]:
        """Yield (decoder, ticks per frame, packets from a key frame at or before ``first``).

        No other reader shares them: a decoder is drained after the last packet.
        """
        container = self._take_container(first)
        try:
            stream = container.streams.video[self._track]
            ticks = ticks_per_frame(stream.time_base)
            yield stream.codec_context, ticks, self._packets(container, part, first, ticks)
        except GeneratorExit:  # the caller has read enough
            self._idle.append(container)
            raise
        except BaseException:
            container.close()
            raise
        self._idle.append(container)

    def _packets(self, container: Any, part: Segment, first: int, ticks: int) -> Iterator[Any]:
        """Yield the packets of a segment from a key frame at or before ``first``."""
        stream = container.streams.video[self._track]
        try:
            if first:
                container.seek(first * ticks, stream=stream)
            for packet in container.demux(stream):
                number = frame_number(packet.pts, ticks)
                if not packet.size or number is None:
                    continue
                if number >= part.stop:
                    break
                if number >= part.first:
                    yield packet
        except FFmpegError as error:
            raise self._bad_segment(part, f"cannot be read: {error.strerror}") from error

    def _take_container(self, first: int) -> av.container.InputContainer:
        """Return an open file for one reader alone, at its beginning if ``first`` is 0.

        It is kept for the next reader: nothing is read twice, and another file that replaces this
        one is not mixed with it.
        """
        while container := self._next_idle():
            if first:
                return container
            try:
                container.seek(0, stream=container.streams.video[self._track])
                return container
            except FFmpegError:  # a file without an index cannot be sought in
                container.close()
        container = open_video(self.path, MOST_STREAMS)
        container.streams.video[self._track].codec_context.thread_count = self.threads
        return container

    def close(self) -> None:
        """Close the file; it is opened again when it is read again."""
        while container := self._next_idle():
            container.close()

    def _next_idle(self) -> av.container.InputContainer | None:
        try:
            return self._idle.pop()
        except IndexError:  # another thread may have taken the last
            return None

    def _bad_segment(self, part: Segment, problem: str) -> StorageError:
        column, row, columns, rows = part.tile.to_json()
        last = f"({column + columns - 1}, {row + rows - 1})"
        place = f"{self.layout.kind} ({column}, {row}) to {last}"
        stream = STREAMS[self._track]
        remedy = "Open the file to salvage the other segments, or make it again"
        problem = f"segment {part.index}{stream} ({place}) {problem}"
        return StorageError(problem, file=self.path, remedy=remedy)
