"""Join segments into one Matroska file, packet by packet, without encoding again."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path

import av

from lfcore import __version__
from lfcore.errors import StorageError
from lfcore.files import WholeFile, whole_file
from lfcore.optics.slab import Slab
from lfcore.storage.codecs import CodecSpec
from lfcore.storage.decoding import FRAME_RATE, ticks_per_frame
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
    progress: Callable[[int, int], None] | None = None,
) -> Metadata:
    """Write the light field file ``path`` from one segment file a tile, in the order of tiles.

    Parameters
    ----------
    geometry : the slab, or a JSON object that describes a camera array.
    scene : JSON object with at least ``name`` and ``digest``.
    spec : what the segments were encoded with, to be recorded.
    content : what else is known, as :class:`Metadata` has it.
    progress : called with (segments done, of all).

    Memory does not grow with the number or length of segments.  Raises :class:`StorageError`,
    with the file's name, when a segment is missing, damaged, of another size, length or encoding
    than the others, and when the result cannot be written; no file is left then.
    """
    path, files = Path(path), [Path(segment) for segment in segments]
    if len(files) != len(tiles) or not files:
        raise StorageError(f"{len(files)} segments for {len(tiles)} tiles", file=path)
    readers = [SegmentReader(file) for file in files]
    header = _header(readers[0])
    parts: list[Segment] = []
    reorder = 0
    for reader, tile in zip(readers, tiles, strict=True):
        info = reader.info()
        _check(reader, info, tile, layout, header, readers[0].codec)
        first = parts[-1].stop if parts else 0
        parts.append(Segment(len(parts), tile, first, info.frames, info.bytes, info.crc32))
        reorder = max(reorder, info.reorder)
    metadata = Metadata(
        geometry="slab" if isinstance(geometry, Slab) else "array",
        slab=geometry if isinstance(geometry, Slab) else None,
        array=None if isinstance(geometry, Slab) else geometry,
        layout=layout,
        codec=readers[0].codec,
        header_crc32=zlib.crc32(header),
        settings=spec.to_json() if spec else {},
        scene=scene,
        segments=tuple(parts),
        software=f"lfcore {__version__}",
        content=content or {},
    )
    metadata.check()
    with whole_file(path) as file, named_errors(path, "joining segments"):
        _mux(file, readers, metadata, reorder, progress or (lambda done, total: None))
    return metadata


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
    readers: list[SegmentReader],
    metadata: Metadata,
    reorder: int,
    progress: Callable[[int, int], None],
) -> None:
    output = av.open(file, "w", format="matroska", options=MUXER_OPTIONS)
    with readers[0].open() as template:
        # opaque: by codec parameters; else FFmpeg looks for an encoder of the decoder's name.
        stream = output.add_stream_from_template(template.streams.video[0], opaque=True)
    stream.time_base = Fraction(1, 1000)
    output.metadata[TAG] = metadata.to_text()
    position = 0  # in the order of decoding
    for reader, part in zip(readers, metadata.segments, strict=True):
        crc = ticks = 0
        for packet in reader.packets():
            crc = zlib.crc32(packet, crc)
            # In the segment's own unit of time; the muxer goes over to milliseconds, exactly.
            ticks = ticks or ticks_per_frame(packet.time_base)
            packet.pts = (packet.pts or 0) + part.first * ticks
            packet.dts, packet.duration = (position - reorder) * ticks, ticks
            packet.stream = stream
            output.mux_one(packet)
            position += 1
        if crc != part.crc32:
            raise StorageError("changed while it was read", file=reader.path)
        progress(part.index + 1, len(readers))
    output.close()
