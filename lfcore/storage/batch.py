"""What one job made: one segment in a file of its own, or several one after the other.

A file of several is Matroska with the tag ``SEGMENTS``: of each segment frames, bytes, check sum
and reordering, so that who joins them reads the video once.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import astuple, dataclass
from itertools import islice
from pathlib import Path

import av

from lfcore.errors import StorageError
from lfcore.storage.ebml import scan
from lfcore.storage.segment import SegmentInfo, SegmentReader, open_video

TAG = "SEGMENTS"
EBML = b"\x1a\x45\xdf\xa3"
_FIELDS = (str, str, int, int, int, int, int, int)
"""Types of :class:`SegmentInfo`."""


@dataclass(frozen=True)
class Batch:
    """The segments of one file, in its order; ``header`` is the codec's global header."""

    path: Path
    infos: tuple[SegmentInfo, ...]
    header: bytes

    def open(self) -> av.container.InputContainer:
        """The file, opened afresh; to be closed by the caller."""
        return open_video(self.path)

    def segments(self) -> Iterator[Iterator[av.Packet]]:
        """The packets of each segment, to be read in turn and to the end.

        Raises :class:`StorageError` where they are others than the index says.
        """
        with self.open() as container:
            video = container.streams.video[0]
            packets = (packet for packet in container.demux(video) if packet.size)
            for info in self.infos:
                yield self._checked(islice(packets, info.frames), info)
            if next(packets, None) is not None:
                raise self._changed()

    def _checked(self, packets: Iterator[av.Packet], info: SegmentInfo) -> Iterator[av.Packet]:
        frames = crc = 0
        for packet in packets:
            frames, crc = frames + 1, zlib.crc32(packet, crc)
            yield packet
        if (frames, crc) != (info.frames, info.crc32):
            raise self._changed()

    def _changed(self) -> StorageError:
        return StorageError(
            "is damaged, or changed while it was read",
            file=self.path,
            remedy="Encode its tiles again",
        )


def read_batch(path: str | Path, *, grey: bool = False) -> Batch:
    """The segments of a file: of a batch by its index, of a segment by reading it once.

    ``grey`` says that they hold no colours, but depths.  Raises :class:`StorageError` for what is
    missing, cut short or neither.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            several = file.read(4) == EBML
    except FileNotFoundError:
        raise StorageError("no such file", file=path) from None
    except OSError as error:
        raise StorageError(f"cannot be read: {error.strerror or error}", file=path) from error
    if not several:
        reader = SegmentReader(path, grey=grey)
        with reader.open() as container:
            return Batch(path, (reader.info(),), _header(container))
    faults = scan(path, clusters=False).faults
    with open_video(path) as container:
        infos = _infos(container.metadata.get(TAG, ""))
        if faults or not infos:
            raise StorageError(
                f"is no batch of segments: {'; '.join(faults) or 'it has no index'}",
                file=path,
                remedy="Encode its tiles again",
            )
        return Batch(path, infos, _header(container))


def batch_tag(infos: Sequence[SegmentInfo]) -> dict[str, str]:
    """The tag of a file that holds these segments."""
    return {TAG: json.dumps([astuple(info) for info in infos], separators=(",", ":"))}


def _infos(text: str) -> tuple[SegmentInfo, ...]:
    """What a tag says; empty when it makes no sense."""
    try:
        rows = json.loads(text)
        right = all(tuple(map(type, row)) == _FIELDS for row in rows)
        return tuple(SegmentInfo(*row) for row in rows) if right else ()
    except (ValueError, TypeError, RecursionError):
        return ()


def _header(container: av.container.InputContainer) -> bytes:
    """The codec's global header: parameter sets that are common to all segments."""
    return container.streams.video[0].codec_context.extradata or b""
