"""Join segments into one Matroska file, packet by packet, without encoding again."""

from __future__ import annotations

import shutil
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import IO, Any, cast
from zipfile import BadZipFile, ZipFile, ZipInfo

import av
import numpy as np

from lfcore import __version__
from lfcore.errors import StorageError
from lfcore.files import WholeFile, draft_folder, whole_file
from lfcore.optics.slab import Slab
from lfcore.storage.codecs import Encoding
from lfcore.storage.decoding import ticks_per_frame
from lfcore.storage.depth_stream import DepthCodes, StoredDepth, StoredSpecular
from lfcore.storage.index import SegmentIndex
from lfcore.storage.instants import Instants
from lfcore.storage.layout import FrameLayout, Tile
from lfcore.storage.metadata import TAG, Metadata
from lfcore.storage.segment import SegmentInfo, named_errors, open_video, read_segment

LONGEST_TAG = 1 << 24
"""The longest text, bytes, that FFmpeg reads from a Matroska file."""
MUXER_OPTIONS = {"avoid_negative_ts": "disabled", "fflags": "bitexact"}
"""The muxer keeps timestamps and writes no random identifiers: same input, same file."""


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
    specular: SpecularSegments | None = None,
    film: Instants | None = None,
) -> Metadata:
    """Write the light field file ``path`` from one segment per tile, in the order of tiles; of a
    ``film`` for each group of instants.

    ``geometry`` is the slab, or a JSON object of a camera array; ``spec``, ``scene`` and
    ``content`` are recorded. Memory grows by a few numbers per segment. After an error no file is
    left.
    """
    path, counts = Path(path), [1]
    if film:
        counts = film.counts
    instants, tiles = np.repeat(counts, len(tiles)).tolist(), list(tiles) * len(counts)
    colours = _Stream.of(path, segments, tiles, layout, instants)
    streams, stored, shown = [colours], None, None

    def add(files: Sequence[Path], layout: FrameLayout, spec: Encoding) -> dict[str, Any]:
        """Add a stream; return the fields of its metadata."""
        stream = _Stream.of(path, files, tiles, layout, instants)
        streams.append(stream)
        sizes = tuple((info.bytes, info.crc32) for info in stream.infos)
        return {
            "codec": stream.infos[0].codec, "header_crc32": zlib.crc32(stream.header),
            "settings": spec.to_json(), "segments": sizes,
        }  # fmt: skip

    def add_depth(depth: DepthSegments) -> StoredDepth:
        grey = replace(layout, pixel_format=depth.codes.pixel_format, peak=None)
        fields = add(depth.segments, grey, depth.spec)
        return StoredDepth(depth.codes, depth.displaced, depth.pixels, **fields)

    if depth:
        stored = add_depth(depth)
    if specular:
        fields = add(specular.segments, layout, specular.spec)
        shown = StoredSpecular(add_depth(specular.depth), **fields)
    numbers = np.empty((len(tiles), 8), np.int64)
    first = 0
    for place, (info, tile) in enumerate(zip(colours.infos, tiles, strict=True)):
        numbers[place] = [*tile.to_json(), first, info.frames, info.bytes, info.crc32]
        first += info.frames
    metadata = Metadata(
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
        depth=stored,
        film=film,
        specular=shown,
    )
    metadata.check()
    text = metadata.to_text()
    if len(text) >= LONGEST_TAG:
        raise StorageError(
            f"{len(tiles)} segments need an index of {len(text)} bytes; {LONGEST_TAG} can be read",
            file=path,
            remedy="Cut the light field into larger tiles: raise tile_mib",
        )
    with whole_file(path) as file, named_errors(path, "joining segments"):
        _mux(file, streams, {TAG: text})
    return metadata


@dataclass(frozen=True)
class DepthSegments:
    """The segments of inverse depths, one per tile, with their encoding ``spec`` and the fields
    that :class:`StoredDepth` records."""

    segments: Sequence[Path]
    codes: DepthCodes
    displaced: bool
    pixels: int
    spec: Encoding


@dataclass(frozen=True)
class SpecularSegments:
    """The segments of specular light, one per tile, with their encoding, and of its depths."""

    segments: Sequence[Path]
    spec: Encoding
    depth: DepthSegments


@dataclass(frozen=True)
class _Stream:
    """The segments of one video stream: their files, and the codec's global header."""

    files: Sequence[Path]
    infos: list[SegmentInfo]
    header: bytes

    @classmethod
    def of(
        cls,
        path: Path,
        files: Sequence[str | Path],
        tiles: Sequence[Tile],
        layout: FrameLayout,
        instants: Sequence[int],
    ) -> _Stream:
        """Raises :class:`StorageError` unless the files are the videos of the tiles, each at so
        many instants."""
        if len(files) != len(tiles) or not files:
            raise StorageError(f"{len(files)} segments for {len(tiles)} tiles", file=path)
        paths = [Path(file) for file in files]
        pairs = [read_segment(file, grey=layout.format.grey) for file in paths]
        infos, headers = [info for info, _ in pairs], [header for _, header in pairs]
        expectations = zip(paths, infos, headers, tiles, instants, strict=True)
        for file, info, header, tile, count in expectations:
            frames = info.width, info.height, info.pixel_format
            expected = layout.frame_width, layout.frame_height, layout.pixel_format
            if frames != expected:
                problem = "has frames of {} x {} {}; the layout needs {} x {} {}"
                raise StorageError(problem.format(*frames, *expected), file=file)
            if info.frames != (needed := count * tile.frame_count):
                problem = f"has {info.frames} frames; tile {tile.index} needs {needed}"
                raise StorageError(problem, file=file, remedy="Encode this tile again")
            if (info.codec, header) != (infos[0].codec, headers[0]):
                problem = "was encoded with other settings than the first segment"
                remedy = "Encode all tiles with the same settings"
                raise StorageError(problem, file=file, remedy=remedy)
        return cls(paths, infos, headers[0])

    def segments(self, output: Any) -> Iterator[Iterator[av.Packet]]:
        """Yield the packets of each segment, for the stream ``output`` and with its times."""
        reorder, first = max(info.reorder for info in self.infos), 0
        for file, info in zip(self.files, self.infos, strict=True):
            with open_video(file) as container:
                yield _packets(container, info, file, first, first - reorder, output)
            first += info.frames


def _packets(
    container: Any, info: SegmentInfo, file: Path, first: int, decoded: int, output: Any
) -> Iterator[av.Packet]:
    """Yield a segment's packets, whose first frame is shown at ``first`` and decoded at
    ``decoded``, frames of the whole; :class:`StorageError` if they do not match ``info``."""
    frames = crc = 0
    for packet in container.demux(container.streams.video[0]):
        if packet.size:
            crc = zlib.crc32(packet, crc)
            # In the segment's unit of time; the muxer converts it to milliseconds, exactly.
            ticks = ticks_per_frame(packet.time_base)
            packet.pts = (packet.pts or 0) + first * ticks
            packet.dts, packet.duration = (decoded + frames) * ticks, ticks
            packet.stream = output
            frames += 1
            yield packet
    if (frames, crc) != (info.frames, info.crc32):
        raise StorageError("changed while it was read", file=file, remedy="Encode its tile again")


def _mux(file: WholeFile, streams: list[_Stream], tags: dict[str, str]) -> None:
    output = av.open(file, "w", format="matroska", options=MUXER_OPTIONS)
    runs = []
    for stream in streams:
        with open_video(stream.files[0], formats=True) as template:
            # opaque: by codec parameters; else FFmpeg looks for an encoder of the decoder's name.
            written = output.add_stream_from_template(template.streams.video[0], opaque=True)
        written.time_base = Fraction(1, 1000)
        runs.append(stream.segments(written))
    output.metadata.update(tags)
    for segments in zip(*runs, strict=True):
        # The streams alternate frame by frame: the muxer buffers packets until their time.
        for packets in zip(*segments, strict=True):
            for packet in packets:
                output.mux_one(packet)
    output.close()


def pack_segments(path: str | Path, segments: Iterable[Path]) -> None:
    """Write a batch of segments into one file, with check sums."""
    with whole_file(path) as file, ZipFile(cast(IO[bytes], file), "w") as batch:
        for segment in segments:
            with segment.open("rb") as source, batch.open(ZipInfo(segment.name), "w") as member:
                shutil.copyfileobj(source, member)


@contextmanager
def unpacked(batches: Iterable[str | Path], beside: str | Path) -> Iterator[list[Path]]:
    """Unpack the segments of batches, in order, for the ``with`` block; a damaged batch raises
    :class:`StorageError`."""
    with draft_folder(beside) as folder:
        segments = []
        for batch in batches:
            try:
                with ZipFile(batch) as packed:
                    segments += [Path(packed.extract(name, folder)) for name in packed.namelist()]
            except (BadZipFile, OSError, EOFError) as error:
                remedy = "Encode its tiles again"
                raise StorageError(f"is damaged: {error}", file=batch, remedy=remedy) from None
        yield segments
