"""Checks of a light field file as a whole: metadata against streams, and damaged segments."""

import zlib
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import av
from av.error import FFmpegError

from lfcore.errors import StorageError
from lfcore.storage.decoding import frame_number, ticks_per_frame
from lfcore.storage.index import Segment
from lfcore.storage.metadata import TAG, Metadata
from lfcore.storage.segment import open_video
from lfcore.storage.stored_video import MOST_STREAMS, StoredVideo

MOST_NAMED = 20
"""The most damaged segments whose numbers an error lists: its line stays readable."""
MOST_REASONS = 3
"""The most segments whose damage an error describes."""


@dataclass(frozen=True)
class Damage:
    """A segment that cannot be read, and why."""

    segment: Segment
    reason: str


def read_metadata(path: Path) -> tuple[Metadata, list[int]]:
    """Read a file's metadata, compare them with its streams, and list its key frames.

    FFmpeg has the key frames from the index at the end (Matroska's Cues) once it has to seek.
    Without that index, as in a file that is cut short, the list ends early.
    """
    with open_video(path, MOST_STREAMS) as container:
        if container.format.name != "matroska,webm":
            remedy = "Give a light field file (.mkv), as 'lfcore record' writes it"
            raise StorageError("is not a Matroska file", file=path, remedy=remedy)
        text = container.metadata.get(TAG)
        if text is None:
            problem = f"is a video, but no light field: it has no tag {TAG}"
            remedy = "Give a lightfield.mkv, as the join of segments writes it"
            raise StorageError(problem, file=path, remedy=remedy)
        metadata = Metadata.from_text(text, path)
        described = metadata.streams
        streams = container.streams.video
        _compare(path, [("streams of video", len(described), len(streams))])
        for stream_metadata, stream in zip(described, streams, strict=True):
            _check_stream(path, stream_metadata, stream)
        with suppress(FFmpegError):  # a damaged index
            container.seek(0, stream=streams[0])
        ticks = ticks_per_frame(streams[0].time_base)
        entries = streams[0].index_entries
        keys = [entry.timestamp // ticks for entry in entries if ticks and entry.is_keyframe]
        return metadata, keys


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
    for name, in_metadata, in_video in pairs:
        if in_metadata != in_video:
            problem = (
                f"contradicts itself: the metadata have {name} {in_metadata}, the video has "
                f"{in_video}"
            )
            raise StorageError(problem, file=path, remedy="Join the segments again")


def segment_damage(streams: Sequence[StoredVideo], part: Segment) -> list[Damage]:
    """Check a segment of all streams; return one entry if it is damaged, else none."""
    try:
        for stream in streams:
            stream.check_segment(part.index)
    except StorageError as error:
        return [Damage(part, error.problem)]
    return []


def find_damage(streams: Sequence[StoredVideo]) -> list[Damage]:
    """Check all segments, and look for frame numbers that two packets claim."""
    colours = streams[0]
    damage = [entry for part in colours.segments for entry in segment_damage(streams, part)]
    once: set[int] = set()
    twice: set[int] = set()  # as in a cluster that has lost its time
    with suppress(FFmpegError), open_video(colours.path, MOST_STREAMS) as container:
        stream = container.streams.video[0]
        ticks = ticks_per_frame(stream.time_base)
        for packet in container.demux(stream):
            number = frame_number(packet.pts, ticks) if packet.size else None
            if number is not None:
                (twice if number in once else once).add(number)
    damaged = {entry.segment.index for entry in damage}
    for part in colours.segments:
        if part.index not in damaged and twice & set(range(part.first, part.stop)):
            damage.append(Damage(part, "has two packets with one number"))
    return damage


def damage_error(path: Path, total: int, damage: Sequence[Damage]) -> StorageError:
    """Return the error of a damaged file: the reasons, and how many of ``total`` segments are
    left."""
    if len(damage) == total:
        readable = f"none of {total} segments can be read"
    else:
        numbers = ", ".join(str(entry.segment.index) for entry in damage[:MOST_NAMED])
        more = ", ..." if len(damage) > MOST_NAMED else ""
        left = total - len(damage)
        readable = f"{left} of {total} segments can still be read, not {numbers}{more}"
    reasons = [entry.reason for entry in damage[:MOST_REASONS]]
    problem = f"is damaged: {'; '.join(reasons)}; {readable}"
    remedy = "Open it to salvage what can be read, or join the segments again"
    return StorageError(problem, file=path, remedy=remedy)
