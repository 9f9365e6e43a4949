"""Join segments into one Matroska file, packet by packet, without encoding again.

A job makes one segment in a file of its own, or a *batch* of several one after the other.  A batch
is Matroska with the tag ``SEGMENTS``: of each segment frames, bytes, check sum and reordering, so
that the join reads the video once.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass, replace
from fractions import Fraction
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any

import av
import numpy as np

from lfcore import __version__
from lfcore.errors import StorageError
from lfcore.files import WholeFile, whole_file
from lfcore.optics.slab import Slab
from lfcore.storage.codecs import Encoding
from lfcore.storage.decoding import FRAME_RATE, ticks_per_frame
from lfcore.storage.depth_stream import DepthCodes, StoredDepth
from lfcore.storage.ebml import scan
from lfcore.storage.index import SegmentIndex
from lfcore.storage.layout import FrameLayout, Tile
from lfcore.storage.metadata import TAG, Metadata
from lfcore.storage.segment import (
    SegmentInfo,
    global_header,
    named_errors,
    open_video,
    read_segment,
)

BATCH_TAG = "SEGMENTS"
EBML = b"\x1a\x45\xdf\xa3"
_FIELDS = (str, str, int, int, int, int, int, int)
"""Types of :class:`SegmentInfo`."""


@dataclass(frozen=True)
class Batch:
    """The segments of one file, in its order; ``header`` is the codec's global header."""

    path: Path
    infos: tuple[SegmentInfo, ...]
    header: bytes

    def segments(self) -> Iterator[Iterator[av.Packet]]:
        """The packets of each segment, to be read in turn and to the end."""
        with open_video(self.path) as container:
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

    ``grey`` says that they hold no colours, but depths.
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
        info, header = read_segment(path, grey=grey)
        return Batch(path, (info,), header)
    faults = scan(path, clusters=False).faults
    with open_video(path) as container:
        infos = _infos(container.metadata.get(BATCH_TAG, ""))
        if faults or not infos:
            raise StorageError(
                f"is no batch of segments: {'; '.join(faults) or 'it has no index'}",
                file=path,
                remedy="Encode its tiles again",
            )
        return Batch(path, infos, global_header(container))


def _infos(text: str) -> tuple[SegmentInfo, ...]:
    """What a tag says; empty when it makes no sense."""
    try:
        rows = json.loads(text)
        right = all(tuple(map(type, row)) == _FIELDS for row in rows)
        return tuple(SegmentInfo(*row) for row in rows) if right else ()
    except (ValueError, TypeError, RecursionError):
        return ()


FRAME_MS = 1000 // FRAME_RATE
"""Milliseconds, Matroska's unit of time, from one frame to the next; exact."""
LONGEST_TAG = 1 << 24
"""Bytes of a text in a Matroska file that FFmpeg reads."""

# Timestamps stay as they are; no random identifiers, so that the same input gives the same file.
MUXER_OPTIONS = {"avoid_negative_ts": "disabled", "fflags": "bitexact"}


def join_segments(
    path: str | Path,
    segments: Sequence[str | Path],
    tiles: Sequence[Tile],
    layout: FrameLayout,
    *,
    geometry: Slab | dict,
    scene: dict,
    spec: Encoding | None = None,
    content: dict | None = None,
    depth: DepthSegments | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Metadata:
    """Write the light field file ``path`` from one segment a tile, in the order of tiles.

    ``segments`` are files of segments and batches; ``geometry`` is the slab, or a JSON object of a
    camera array; ``spec``, ``scene`` and ``content`` are recorded. Memory grows by a few numbers a
    segment. After an error no file is left.
    """
    path = Path(path)
    streams = [_Stream.of(path, segments, tiles, layout)]
    if depth:
        streams.append(_Stream.of(path, depth.segments, tiles, layout, depth.codes))
    colours = streams[0]
    numbers = np.empty((len(tiles), 8), np.int64)
    first = 0
    for place, (info, tile) in enumerate(zip(colours.infos, tiles, strict=True)):
        numbers[place] = [*tile.to_json(), first, info.frames, info.bytes, info.crc32]
        first += info.frames
    metadata = Metadata(
        geometry="slab" if isinstance(geometry, Slab) else "array",
        slab=geometry if isinstance(geometry, Slab) else None,
        array=None if isinstance(geometry, Slab) else geometry,
        layout=layout,
        codec=colours.infos[0].codec,
        header_crc32=zlib.crc32(colours.header),
        settings=spec.to_json() if spec else {},
        scene=scene,
        segments=SegmentIndex(layout, numbers),
        software=f"lfcore {__version__}",
        content=content or {},
        depth=depth.described(streams[1]) if depth else None,
    )
    metadata.check()
    text = metadata.to_text()
    if len(text) >= LONGEST_TAG:
        raise StorageError(
            f"{len(tiles)} segments need an index of {len(text)} bytes; {LONGEST_TAG} can be read",
            file=path,
            remedy="Cut the light field into larger tiles: raise tile_mib",
        )
    _write(path, streams, {TAG: text}, progress)
    return metadata


def write_batch(path: str | Path, segments: Sequence[str | Path]) -> None:
    """Write several segments of one encoding, one after the other, into the one file ``path``.

    A batch stands for its segments wherever these are joined.  Raises as :func:`join_segments`.
    """
    stream = _Stream([read_batch(segment) for segment in segments])
    for one in stream.batches:
        _check_encoding(one, stream.batches[0])
    index = json.dumps([astuple(info) for info in stream.infos], separators=(",", ":"))
    _write(Path(path), [stream], {BATCH_TAG: index})


@dataclass(frozen=True)
class DepthSegments:
    """Inverse depths to be joined: one segment a tile, encoded with ``spec``, and what they hold,
    as in :class:`StoredDepth`."""

    segments: Sequence[Path]
    codes: DepthCodes
    displaced: bool
    pixels: int
    spec: Encoding

    def described(self, stream: _Stream) -> StoredDepth:
        """What the metadata say of them."""
        return StoredDepth(
            self.codes, self.displaced, self.pixels, stream.infos[0].codec,
            zlib.crc32(stream.header), self.spec.to_json(),
            tuple((info.bytes, info.crc32) for info in stream.infos),
        )  # fmt: skip


@dataclass(frozen=True)
class _Stream:
    """The segments of one video stream, in files of one or several."""

    batches: list[Batch]

    @classmethod
    def of(
        cls,
        path: Path,
        files: Sequence[str | Path],
        tiles: Sequence[Tile],
        layout: FrameLayout,
        codes: DepthCodes | None = None,
    ) -> _Stream:
        """Raises :class:`StorageError` unless the files are the videos of the tiles."""
        if codes:
            layout = replace(layout, pixel_format=codes.pixel_format, peak=None)
        found = cls([read_batch(file, grey=codes is not None) for file in files])
        if len(found.infos) != len(tiles) or not files:
            raise StorageError(f"{len(found.infos)} segments for {len(tiles)} tiles", file=path)
        whose = (batch for batch in found.batches for _ in batch.infos)
        for batch, info, tile in zip(whose, found.infos, tiles, strict=True):
            _check(batch, info, tile, layout, found.batches[0])
        return found

    @cached_property
    def infos(self) -> list[SegmentInfo]:
        return [info for batch in self.batches for info in batch.infos]

    @property
    def header(self) -> bytes:
        return self.batches[0].header

    def segments(self, made: Any) -> Iterator[Iterator[av.Packet]]:
        """The packets of each segment in turn, with their times in the whole file."""
        reorder = max(info.reorder for info in self.infos)
        first = 0
        for batch in self.batches:
            place = first
            for info, packets in zip(batch.infos, batch.segments(), strict=True):
                yield _timed(packets, first, place - reorder, made)
                place += info.frames
            first = place


def _check(batch: Batch, info: SegmentInfo, tile: Tile, layout: FrameLayout, first: Batch) -> None:
    """Raise :class:`StorageError` unless the segment is the video of the tile."""
    expected = (layout.frame_width, layout.frame_height, layout.pixel_format)
    if (info.width, info.height, info.pixel_format) != expected:
        raise StorageError(
            f"has frames of {info.width} x {info.height} {info.pixel_format}; the layout needs "
            "{} x {} {}".format(*expected),
            file=batch.path,
        )
    if info.frames != tile.frame_count:
        raise StorageError(
            f"has {info.frames} frames; tile {tile.index} needs {tile.frame_count}",
            file=batch.path,
            remedy="Encode this tile again",
        )
    _check_encoding(batch, first)


def _check_encoding(batch: Batch, first: Batch) -> None:
    if (batch.infos[0].codec, batch.header) != (first.infos[0].codec, first.header):
        raise StorageError(
            "was encoded with other settings than the first segment",
            file=batch.path,
            remedy="Encode all tiles with the same settings",
        )


def _write(
    path: Path,
    streams: list[_Stream],
    tags: dict[str, str],
    progress: Callable[[int, int], None] | None = None,
) -> None:
    with whole_file(path) as file, named_errors(path, "joining segments"):
        _mux(file, streams, tags, progress or (lambda done, total: None))


def _mux(
    file: WholeFile,
    streams: list[_Stream],
    tags: dict[str, str],
    progress: Callable[[int, int], None],
) -> None:
    output = av.open(file, "w", format="matroska", options=MUXER_OPTIONS)
    written = []
    for stream in streams:
        with open_video(stream.batches[0].path) as template:
            # opaque: by codec parameters; else FFmpeg looks for an encoder of the decoder's name.
            made = output.add_stream_from_template(template.streams.video[0], opaque=True)
        made.time_base = Fraction(1, 1000)
        written.append(made)
    output.metadata.update(tags)
    runs = [stream.segments(made) for stream, made in zip(streams, written, strict=True)]
    for done, segments in enumerate(zip(*runs, strict=True), 1):
        # Frame by frame in turn: the muxer holds back what comes before its time.
        for packets in zip(*segments, strict=True):
            for packet in packets:
                output.mux_one(packet)
        progress(done, len(streams[0].infos))
    output.close()


def _timed(
    packets: Iterator[av.Packet], first: int, decoded: int, made: Any
) -> Iterator[av.Packet]:
    """Packets of a file whose frame 0 is ``first`` of the whole, decoded from ``decoded`` on."""
    for place, packet in enumerate(packets, decoded):
        # In the file's own unit of time; the muxer goes over to milliseconds, exactly.
        ticks = ticks_per_frame(packet.time_base)
        packet.pts = (packet.pts or 0) + first * ticks
        packet.dts, packet.duration = place * ticks, ticks
        packet.stream = made
        yield packet
