"""Join segments into one Matroska file, packet by packet, without encoding again."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import av

from lfcore import __version__
from lfcore.errors import StorageError
from lfcore.files import WholeFile, whole_file
from lfcore.optics.slab import Slab
from lfcore.storage.codecs import CodecSpec
from lfcore.storage.decoding import FRAME_RATE, ticks_per_frame
from lfcore.storage.depth_stream import DepthCodes, StoredDepth
from lfcore.storage.layout import FrameLayout, Tile
from lfcore.storage.metadata import TAG, Metadata, Segment
from lfcore.storage.segment import SegmentInfo, SegmentReader, named_errors

FRAME_MS = 1000 // FRAME_RATE
"""Milliseconds, Matroska's unit of time, from one frame to the next; exact."""

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
    spec: CodecSpec | None = None,
    content: dict | None = None,
    depth: DepthSegments | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Metadata:
    """Write the light field file ``path`` from one segment file a tile, in the order of tiles.

    Parameters
    ----------
    geometry : the slab, or a JSON object that describes a camera array.
    scene : JSON object with at least ``name`` and ``digest``.
    spec : what the segments were encoded with, to be recorded.
    content : what else is known, as :class:`Metadata` has it.
    depth : of inverse depths, a second stream.
    progress : called with (segments done, of all).

    Memory does not grow with the number or length of segments.  Raises :class:`StorageError`,
    with the file's name, when a segment is missing, damaged, of another size, length or encoding
    than the others, and when the result cannot be written; no file is left then.
    """
    path, files = Path(path), [Path(segment) for segment in segments]
    colours = _Stream.of(path, files, tiles, layout)
    streams = [colours]
    if depth:
        streams.append(_Stream.of(path, depth.segments, tiles, layout, depth.codes))
    parts: list[Segment] = []
    for tile, info in zip(tiles, colours.infos, strict=True):
        first = parts[-1].stop if parts else 0
        parts.append(Segment(len(parts), tile, first, info.frames, info.bytes, info.crc32))
    metadata = Metadata(
        geometry="slab" if isinstance(geometry, Slab) else "array",
        slab=geometry if isinstance(geometry, Slab) else None,
        array=None if isinstance(geometry, Slab) else geometry,
        layout=layout,
        codec=colours.readers[0].codec,
        header_crc32=zlib.crc32(colours.header),
        settings=spec.to_json() if spec else {},
        scene=scene,
        segments=tuple(parts),
        software=f"lfcore {__version__}",
        content=content or {},
        depth=depth.described(streams[1]) if depth else None,
    )
    metadata.check()
    with whole_file(path) as file, named_errors(path, "joining segments"):
        _mux(file, streams, metadata, progress or (lambda done, total: None))
    return metadata


@dataclass(frozen=True)
class DepthSegments:
    """Inverse depths to be joined: one segment file a tile, and what they hold.

    ``lattice`` and ``pixels`` are those of :class:`StoredDepth`; ``spec`` is what the segments
    were encoded with.
    """

    segments: Sequence[Path]
    codes: DepthCodes
    lattice: str
    pixels: int
    spec: CodecSpec

    def described(self, stream: _Stream) -> StoredDepth:
        """What the metadata say of them."""
        return StoredDepth(
            self.codes, self.lattice, self.pixels, stream.readers[0].codec,
            zlib.crc32(stream.header), self.spec.to_json(),
            tuple((info.bytes, info.crc32) for info in stream.infos),
        )  # fmt: skip


@dataclass(frozen=True)
class _Stream:
    """The segments of one video stream, checked."""

    readers: list[SegmentReader]
    infos: list[SegmentInfo]
    header: bytes

    @classmethod
    def of(
        cls,
        path: Path,
        files: Sequence[Path],
        tiles: Sequence[Tile],
        layout: FrameLayout,
        codes: DepthCodes | None = None,
    ) -> _Stream:
        """Raises :class:`StorageError` unless the files are the videos of the tiles."""
        if len(files) != len(tiles) or not files:
            raise StorageError(f"{len(files)} segments for {len(tiles)} tiles", file=path)
        if codes:
            layout = replace(layout, pixel_format=codes.pixel_format)
        readers = [SegmentReader(file, grey=codes is not None) for file in files]
        header, infos = _header(readers[0]), []
        for reader, tile in zip(readers, tiles, strict=True):
            infos.append(reader.info())
            _check(reader, infos[-1], tile, layout, header, readers[0].codec)
        return cls(readers, infos, header)

    @property
    def reorder(self) -> int:
        return max(info.reorder for info in self.infos)


def _header(reader: SegmentReader) -> bytes:
    """The codec's global header: parameter sets that are common to all segments."""
    with reader.open() as container:
        return container.streams.video[0].codec_context.extradata or b""


def _check(
    reader: SegmentReader,
    info: SegmentInfo,
    tile: Tile,
    layout: FrameLayout,
    header: bytes,
    codec: str,
) -> None:
    """Raise :class:`StorageError` unless the segment is the video of the tile."""
    expected = (layout.frame_width, layout.frame_height, layout.pixel_format)
    if (info.width, info.height, info.pixel_format) != expected:
        raise StorageError(
            f"has frames of {info.width} x {info.height} {info.pixel_format}; the layout needs "
            "{} x {} {}".format(*expected),
            file=reader.path,
        )
    if info.frames != tile.frame_count:
        raise StorageError(
            f"has {info.frames} frames; tile {tile.index} needs {tile.frame_count}",
            file=reader.path,
            remedy="Encode this tile again",
        )
    if reader.codec != codec or _header(reader) != header:
        raise StorageError(
            "was encoded with other settings than the first segment",
            file=reader.path,
            remedy="Encode all tiles with the same settings",
        )


def _mux(
    file: WholeFile,
    streams: list[_Stream],
    metadata: Metadata,
    progress: Callable[[int, int], None],
) -> None:
    output = av.open(file, "w", format="matroska", options=MUXER_OPTIONS)
    written = []
    for stream in streams:
        with stream.readers[0].open() as template:
            # opaque: by codec parameters; else FFmpeg looks for an encoder of the decoder's name.
            made = output.add_stream_from_template(template.streams.video[0], opaque=True)
        made.time_base = Fraction(1, 1000)
        written.append(made)
    output.metadata[TAG] = metadata.to_text()
    for part in metadata.segments:
        runs = [_packets(stream, part, made) for stream, made in zip(streams, written, strict=True)]
        # Frame by frame in turn: the muxer holds back what comes before its time.
        for packets in zip(*runs, strict=True):
            for packet in packets:
                output.mux_one(packet)
        progress(part.index + 1, len(metadata.segments))
    output.close()


def _packets(stream: _Stream, part: Segment, made: Any) -> Iterator[av.Packet]:
    """The packets of one segment, with their times in the whole file."""
    reader, crc, ticks = stream.readers[part.index], 0, 0
    for place, packet in enumerate(reader.packets(), part.first):
        crc = zlib.crc32(packet, crc)
        # In the segment's own unit of time; the muxer goes over to milliseconds, exactly.
        ticks = ticks or ticks_per_frame(packet.time_base)
        packet.pts = (packet.pts or 0) + part.first * ticks
        packet.dts, packet.duration = (place - stream.reorder) * ticks, ticks
        packet.stream = made
        yield packet
    if crc != stream.infos[part.index].crc32:
        raise StorageError("changed while it was read", file=reader.path)
