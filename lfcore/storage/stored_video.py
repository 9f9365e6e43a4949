"""The video of a light field file: its segments, checked before they are read, and its damage.

Nothing is handed out from a segment before its check sum was found right.
"""

import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Self

import av
import numpy as np
from av.error import FFmpegError

from lfcore.errors import StorageError
from lfcore.progress import Progress
from lfcore.storage.container import FRAME_MS
from lfcore.storage.decoding import decoded_planes, frame_number, packed, ticks_per_frame
from lfcore.storage.ebml import Structure, scan
from lfcore.storage.index import FIRST, Segment
from lfcore.storage.layout import FrameLayout
from lfcore.storage.metadata import TAG, Metadata
from lfcore.storage.remote import located
from lfcore.storage.segment import open_video

MOST_STREAMS = 2
"""Of video: colours, and inverse depths where they are known."""


@dataclass(frozen=True)
class Damage:
    """A segment that cannot be read, and why."""

    segment: Segment
    reason: str


class StoredVideo:
    """The segments of an open light field file; see :meth:`open`.

    Attributes
    ----------
    damage : list of Damage
        Segments that cannot be read; only with ``salvage``, else damage is an error.
    count : SimpleNamespace
        ``count.frames`` are the frames decoded so far, with those that only led to others.
    decoded_segments : set of int
        The numbers of their segments.
    depth_video : StoredVideo or None
        The stream of inverse depths, the file's second video.
    """

    def __init__(
        self, path: Path, metadata: Metadata, keys: list[int], threads: int, track: int = 0
    ):
        self.path, self.metadata, self.threads = path, metadata, threads
        self.depth_video: StoredVideo | None = None
        if metadata.depth:
            self.depth_video = StoredVideo(path, metadata.of_depth(), keys, threads, track + 1)
        self._track, self._salvage = track, False
        self.count = SimpleNamespace(frames=0)
        self.decoded_segments: set[int] = set()
        self.damage: list[Damage] = []
        self._checked: dict[int, np.ndarray] = {}  # the sums of a segment's packets
        self._keys = keys
        self._idle: list[av.container.InputContainer] = []

    @classmethod
    def open(cls, path: str | Path, *, salvage: bool = False, threads: int = 1) -> Self:
        """Open a light field file.

        Parameters
        ----------
        path : str or Path
            A file, or a URL that fsspec knows; of a URL, only the ranges that are read are fetched.
        salvage : bool
            Open a damaged file for its whole segments: all are checked, and ``damage`` lists those
            that cannot be read.
        threads : int
            Threads of a decoder.

        Returns
        -------
        LightField
            The file, opened.

        Raises
        ------
        StorageError
            The file is missing, foreign, cut short, damaged outside the video, lacks segments or
            contradicts itself; says what is damaged and what can still be read.
        """
        path = located(path)
        structure = scan(path, clusters=False)
        metadata = _read_metadata(path, structure)
        field = cls(path, metadata, [key // FRAME_MS for key in structure.keys], threads)
        field._salvage = salvage
        if salvage:
            field._find_damage()
        elif structure.faults:
            field._find_damage()
            raise field._report(structure.faults, field.damage)
        else:
            index = metadata.segments
            held = np.isin(index.numbers[:, FIRST], field._keys) | (not field._keys)
            gone = np.flatnonzero(~held).tolist()
            missing = [Damage(index[k], f"segment {k} is missing") for k in gone]
            if missing:
                raise field._report([], missing)
        return field

    def __repr__(self) -> str:
        segments = len(self.metadata.segments)
        return f"<{type(self).__name__} of {str(self.path)!r}: {segments} segments>"

    @property
    def layout(self) -> FrameLayout:
        """How rays lie in frames."""
        return self.metadata.layout

    @property
    def segments(self) -> Sequence[Segment]:
        """The segments that can be read, as far as is known."""
        if not self.damage:
            return self.metadata.segments
        bad = {damage.segment.index for damage in self.damage}
        return tuple(part for part in self.metadata.segments if part.index not in bad)

    def check_segment(self, index: int) -> None:
        """Read a segment without decoding it, and compare its packets with the index.

        Raises :class:`StorageError` where packets are missing, displaced or changed.
        """
        part = self.metadata.segments[index]
        frames = size = crc = 0
        crc_of: dict[int, int] = {}  # frame number: that of its packet
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

    def verify(self, progress: Progress | None = None) -> None:
        """Check every byte of the file and every segment, of colours and of depths.

        ``progress`` is called with (segments done, of all).  Raises :class:`StorageError` that
        names all damaged segments and what can still be read.
        """
        structure = scan(self.path, clusters=True)
        bad = []
        for part in self.metadata.segments:
            bad += self._damage_of(part)
            if progress:
                progress(part.index + 1, len(self.metadata.segments))
        if bad or structure.faults:
            raise self._report(structure.faults, bad)

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
        """As :meth:`frames`, one by one without a copy: planes (h, w) in the decoder's memory."""
        part, stop = self._span(segment, start, stop)
        if (wanted := start) == stop:
            return
        self.decoded_segments.add(segment)
        layout = self.layout
        size = layout.frame_width, layout.frame_height
        with self._reader(part, part.first + start) as (context, ticks, packets):
            checked = self._as_checked(part, packets, ticks)
            decoded = decoded_planes(self.path, context, checked, ticks, layout.format, size)
            for number, planes in decoded:
                self.count.frames += 1
                if number - part.first > wanted:
                    break
                if number - part.first == wanted:
                    yield planes
                    wanted += 1
                    if wanted == stop:
                        return
            problem = f"frame {wanted} of {start} to {stop - 1} is missing from the stream"
            raise StorageError(problem, file=self.path)

    def _span(self, segment: int, start: int, stop: int | None) -> tuple[Segment, int]:
        """A segment, checked, and the frame after the last of it that is wanted."""
        if not 0 <= segment < len(self.metadata.segments):
            raise StorageError(f"there is no segment {segment}", file=self.path)
        part = self.metadata.segments[segment]
        stop = part.frames if stop is None else stop
        if not 0 <= start <= stop <= part.frames:
            problem = f"frames {start} to {stop} were asked for of {part.frames}"
            raise StorageError(problem, file=self.path)
        if segment not in self._checked:
            self.check_segment(segment)
        return part, stop

    def _as_checked(self, part: Segment, packets: Iterable[Any], ticks: int) -> Iterator[Any]:
        """The packets, as long as each is what :meth:`check_segment` read under its number.

        In a damaged file two packets may claim one number; which of them is met depends on where
        a reader comes from.
        """
        crcs, first = self._checked[part.index], True
        for packet in packets:
            if zlib.crc32(packet) != crcs[packet.pts // ticks - part.first]:
                raise self._bad_segment(part, "holds two packets of one number")
            if first and not packet.is_keyframe:
                raise self._bad_segment(part, "is entered where no key frame is")
            first = False
            yield packet

    @contextmanager
    def _reader(self, part: Segment, first: int) -> Iterator[tuple[Any, int, Iterator[Any]]]:
        """(decoder, ticks a frame, packets from a key frame at or before ``first``).

        They are this reader's alone until it ends: a decoder is drained after the last packet.
        """
        container = self._take_container(first)
        try:
            stream = container.streams.video[self._track]
            ticks = ticks_per_frame(stream.time_base)
            yield stream.codec_context, ticks, self._packets(container, part, first, ticks)
        except GeneratorExit:  # enough was read
            self._idle.append(container)
            raise
        except BaseException:
            container.close()
            raise
        self._idle.append(container)

    def _packets(self, container: Any, part: Segment, first: int, ticks: int) -> Iterator[Any]:
        """The packets of a segment from a key frame at or before ``first``."""
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
        """The open file for one reader alone; before the beginning where ``first`` is 0.

        Once opened, it is kept for the next reader: nothing of the file is read twice, and one of
        the same name that takes its place meanwhile is not mixed with it.
        """
        while container := self._next_idle():
            if first:
                return container
            try:
                container.seek(0, stream=container.streams.video[self._track])
                return container
            except FFmpegError:  # a file without its index is read from its beginning only
                container.close()
        container = open_video(self.path, MOST_STREAMS)
        container.streams.video[self._track].codec_context.thread_count = self.threads
        return container

    def close(self) -> None:
        """Close the file; it is opened again when it is read again."""
        while container := self._next_idle():
            container.close()
        if self.depth_video:
            self.depth_video.close()

    def _next_idle(self) -> av.container.InputContainer | None:
        try:
            return self._idle.pop()
        except IndexError:  # several threads read at a time
            return None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _bad_segment(self, part: Segment, problem: str) -> StorageError:
        a, b, c, d = part.tile.to_json()
        of = " of the depths" if self._track else ""
        where = f"{self.layout.kind} ({a}, {b}) to ({a + c - 1}, {b + d - 1})"
        remedy = "Open the file to salvage the other segments, or make it again"
        whole = f"segment {part.index}{of} ({where}) {problem}"
        return StorageError(whole, file=self.path, remedy=remedy)

    def _find_damage(self) -> None:
        for part in self.metadata.segments:
            self.damage += self._damage_of(part)
        met: set[int] = set()
        twice: set[int] = set()  # numbers of two packets, as where a cluster has lost its time
        with suppress(FFmpegError), open_video(self.path, MOST_STREAMS) as container:
            stream = container.streams.video[self._track]
            ticks = ticks_per_frame(stream.time_base)
            for packet in container.demux(stream):
                number = frame_number(packet.pts, ticks) if packet.size else None
                if number is not None:
                    (twice if number in met else met).add(number)
        for part in self.segments:
            if twice & set(range(part.first, part.stop)):
                self.damage.append(Damage(part, "holds two packets of one number"))

    def _damage_of(self, part: Segment) -> list[Damage]:
        """What is found wrong with a segment, of colours or of depths."""
        try:
            self.check_segment(part.index)
            if self.depth_video:
                self.depth_video.check_segment(part.index)
        except StorageError as error:
            return [Damage(part, error.problem)]
        return []

    def _report(self, faults: list[str], bad: list[Damage]) -> StorageError:
        total = len(self.metadata.segments)
        if not bad:
            readable = f"all {total} segments can still be read"
        elif len(bad) == total:
            readable = f"none of {total} segments can be read"
        else:
            numbers = ", ".join(str(damage.segment.index) for damage in bad[:20])
            more = ", ..." if len(bad) > 20 else ""
            readable = (
                f"{total - len(bad)} of {total} segments can still be read, not {numbers}{more}"
            )
        reasons = [*faults, *(damage.reason for damage in bad[: 0 if faults else 3])]
        problem = f"is damaged: {'; '.join(reasons)}; {readable}"
        remedy = "Open it to salvage what can be read, or join the segments again"
        return StorageError(problem, file=self.path, remedy=remedy)


def _read_metadata(path: Path, structure: Structure) -> Metadata:
    """The metadata of a file, checked against its video streams; damage goes before all else."""
    try:
        with open_video(path, MOST_STREAMS) as container:
            text = container.metadata.get(TAG)
            if text is None:
                problem = f"is a video, but no light field: it has no tag {TAG}"
                remedy = "Give a lightfield.mkv, as the join of segments writes it"
                raise StorageError(problem, file=path, remedy=remedy)
            metadata = Metadata.from_text(text, path)
            said = [metadata, metadata.of_depth()] if metadata.depth else [metadata]
            streams = container.streams.video
            _compare(path, [("streams of video", len(said), len(streams))])
            for one, stream in zip(said, streams, strict=True):
                _check_stream(path, one, stream)
            return metadata
    except StorageError:
        if structure.faults:
            problem = f"is damaged: {'; '.join(structure.faults)}; nothing can be read"
            raise StorageError(problem, file=path) from None
        raise


def _check_stream(path: Path, metadata: Metadata, stream: av.VideoStream) -> None:
    """Raise :class:`StorageError` when the metadata contradict the video stream."""
    context, layout = stream.codec_context, metadata.layout
    pairs = [  # pixel formats are compared when frames are decoded
        ("codec", metadata.codec, context.codec.canonical_name),
        ("frame width", layout.frame_width, context.width),
        ("frame height", layout.frame_height, context.height),
        ("global header check sum", metadata.header_crc32, zlib.crc32(context.extradata or b"")),
    ]
    _compare(path, pairs)


def _compare(path: Path, pairs: Iterable[tuple[str, object, object]]) -> None:
    for what, said, found in pairs:
        if said != found:
            problem = f"contradicts itself: the metadata say {what} {said}, the video has {found}"
            raise StorageError(problem, file=path, remedy="Join the segments again")
