"""Light field files with four codecs, one with depths; contradictory metadata with a right
digest."""

import hashlib
import itertools
import json
from dataclasses import replace
from fractions import Fraction
from functools import cache, partial
from pathlib import Path

import av
import numpy as np

from lfcore.optics.array import CameraArray
from lfcore.optics.camera import Camera
from lfcore.optics.slab import Slab
from lfcore.storage.codecs import Encoding
from lfcore.storage.container import DepthSegments, SpecularSegments, join_segments
from lfcore.storage.depth_stream import DepthCodes
from lfcore.storage.index import Segment
from lfcore.storage.layout import FrameLayout
from lfcore.storage.lightfield import LightFieldFile
from lfcore.storage.metadata import TAG
from lfcore.storage.segment import SegmentWriter
from robustness.inputs import damaged_bytes, damaged_json
from robustness.outcome import Outcome, SilentlyWrong, outcome_of
from robustness.targets import Target, seeds_folder

VIEWS = 4
"""The views per side of the files."""
PIXELS = 8
"""The pixels per side of the files."""
CODECS = {
    "x264": Encoding("libx264", "yuv444p", crf=10, preset="veryfast", gop=6),
    "x265": Encoding("libx265", "yuv420p", crf=10, preset="fast", gop=6),
    "av1": Encoding("libsvtav1", "yuv420p", crf=10, preset="10", gop=6),
    "ffv1": Encoding("ffv1", "gbrp", crf=0, preset=None, tune=None),
    "depth": Encoding("libx264", "yuv444p", crf=10, preset="veryfast", gop=6),
    "specular": Encoding("libx264", "yuv444p", crf=10, preset="veryfast", gop=6),
}
VIRTUAL = DepthCodes(0.0, 0.5, absent=200)
DEPTHS = DepthCodes(0.0, 0.5)
DEPTH_SPEC = Encoding("libx264", "gray", crf=10, preset="veryfast", gop=6)
PACKS = {"av1": 8, "x265": 12}
"""The elements per side of a frame, for frames of 64 and 96 pixels, which some encoders need."""


@cache
def whole_store(name: str, folder: Path, geometry: str = "slab") -> tuple[bytes, bytes]:
    """Return (file, all its pixels) of a light field with noise in about four segments."""
    spec, pack = CODECS[name], PACKS.get(name, 1)
    pixels = 16 if pack > 1 else PIXELS
    layout = FrameLayout(
        "macropixels", 8 if pack > 1 else VIEWS, pixels, pack=pack, pixel_format=spec.stored_format
    )
    tiles = layout.tiles(layout.rays, least=4, small_rays=0)
    noise = np.random.default_rng(5)

    def segments(suffix: str, spec: Encoding, layout: FrameLayout) -> list[Path]:
        paths = [folder / f"{name}-{tile.index}{suffix}.mp4" for tile in tiles]
        for tile, path in zip(tiles, paths, strict=True):
            size = layout.frame_width, layout.frame_height
            with SegmentWriter(path, spec, *size) as writer:
                level = noise.integers(60, 180, (tile.frame_count, 1), np.uint8)
                fine = noise.integers(0, 40, (tile.frame_count, layout.frame_bytes), np.uint8)
                writer.write(level + fine)
        return paths

    colours, depth, specular = segments("", spec, layout), None, None
    grey = replace(layout, pixel_format=DEPTHS.pixel_format)
    if name in ("depth", "specular"):
        depths = segments("-depth", DEPTH_SPEC, grey)
        depth = DepthSegments(depths, DEPTHS, True, PIXELS, DEPTH_SPEC)
    if name == "specular":
        depths = segments("-virtual", DEPTH_SPEC, grey)
        virtual = DepthSegments(depths, VIRTUAL, True, PIXELS, DEPTH_SPEC)
        specular = SpecularSegments(segments("-specular", spec, layout), spec, virtual)
    path = folder / f"{name}.mkv"
    join_segments(
        path, colours, tiles, layout, spec=spec, scene={"name": "waves", "digest": "0123"},
        geometry=_geometry(geometry, layout), depth=depth, specular=specular,
    )  # fmt: skip
    return path.read_bytes(), pixels_of(LightFieldFile.open(path))


def _geometry(kind: str, layout: FrameLayout) -> Slab | dict:
    if kind == "slab":
        return Slab(Camera(0.05, 0.036, 2.0, 3.0), layout.views, layout.pixels)
    array = CameraArray.on_grid((layout.views,) * 2, (-1, 1, -1, 1), 40.0, (layout.pixels,) * 2)
    return array.to_json() | {"white": 1.5}


def pixels_of(field: LightFieldFile) -> bytes:
    light = field.rectangle(0, 0, field.layout.pixels, field.layout.pixels, codes=True).tobytes()
    return light + b"".join(map(depths_of, [field] * len(field.segments), field.segments))


def depths_of(field: LightFieldFile, part: Segment) -> bytes:
    """Return the depth frames of a segment, and the virtual ones; empty if the file has none."""
    parts = [field] if field.specular is None else [field, field.specular]
    videos = [each.depth_video for each in parts if each.depth_video]
    return b"".join(some.tobytes() for video in videos for some in video.frames(part.index))


def store_seeds(name: str, folder: Path) -> list[bytes]:
    return [whole_store(name, folder)[0]]


def judge_store(name: str, data: bytes, folder: Path) -> Outcome:
    """Read a damaged file: its pixels must be right, or refused."""
    _, right = whole_store(name, seeds_folder(folder))
    file = folder / "input.mkv"
    file.write_bytes(data)
    outcome = outcome_of(lambda: _read_all(file, right), names=str(file))
    if outcome.is_finding:
        return outcome
    salvaged = outcome_of(lambda: _salvage(file, right), names=str(file))
    return salvaged if salvaged.is_finding else outcome


def _read_all(file: Path, right: bytes) -> None:
    field = LightFieldFile.open(file)
    if pixels_of(field) != right:
        raise SilentlyWrong("other pixels than were stored")
    field.view(1, 1, codes=True)
    field.verify()


def _salvage(file: Path, right: bytes) -> None:
    field = LightFieldFile.open(file, salvage=True)
    size, side = field.layout.pixels, field.layout.views
    whole = np.frombuffer(right, np.uint8)
    samples = size * size * side * side * 3
    depths, whole = right[samples:], whole[:samples]
    if whole.size != samples or (field.depth_video is not None) != bool(depths):
        raise SilentlyWrong("a light field of another size")
    whole = whole.reshape(size, size, side, side, 3)
    known = np.zeros((size, size), bool)
    frame = len(depths) // max(1, field.metadata.segments.frames)
    for part in field.segments:
        if depths_of(field, part) != depths[part.first * frame : part.stop * frame]:
            raise SilentlyWrong("other depths than were stored, when salvaged")
        tile = part.tile
        known[tile.row : tile.row + tile.rows, tile.column : tile.column + tile.columns] = True
    pixels = field.rectangle(0, 0, size, size, codes=True)
    if (pixels[known] != whole[known]).any() or pixels[~known].any():
        raise SilentlyWrong("other pixels than were stored, when salvaged")


SEEDS = {"slab": ("x264", "slab"), "array": ("x264", "array"), "depth": ("depth", "slab"),
         "specular": ("specular", "slab")}  # fmt: skip
"""The file and the geometry whose metadata are damaged."""


def metadata_seeds(home: Path) -> list[bytes]:
    seeds = []
    for kind, (name, geometry) in SEEDS.items():
        folder = home / kind
        folder.mkdir(exist_ok=True)
        whole_store(name, folder, geometry)
        with av.open(str(folder / f"{name}.mkv")) as container:
            data = json.loads(container.metadata[TAG])
        data.pop("digest")
        seeds.append(json.dumps(data).encode())
    return seeds


def sealed(text: bytes) -> str:
    """Return the metadata, wrong or not, with a right digest."""
    try:
        data = json.loads(text)
        canonical = json.dumps(data, sort_keys=True, separators=(",", ":"))
        digest = hashlib.sha256(canonical.encode()).hexdigest()
        return json.dumps(data | {"digest": digest})
    except (ValueError, TypeError, RecursionError):
        return text.decode("utf-8", "replace")


def judge_metadata(data: bytes, folder: Path) -> Outcome:
    """Open, describe and read a file with these metadata and an intact video."""
    from lfcore.cli.inspect import facts
    from lfcore.lightfield import LightField as Refocusable

    file = folder / "input.mkv"
    kind = "array" if b'"geometry": "array"' in data else "slab"
    kind = "depth" if b'"dioptres"' in data else kind
    kind = "specular" if b'"specular"' in data else kind
    _remux(seeds_folder(folder) / kind / f"{SEEDS[kind][0]}.mkv", file, sealed(data))

    def work() -> None:
        field = Refocusable.open(file)
        facts(field)
        json.loads(field.metadata.to_text())
        field.view(0, 0, codes=True)
        field.macropixel(0, 0, codes=True)
        field.verify()
        for part in field.segments:
            depths_of(field, part)

    return outcome_of(work, names=str(file))


def _remux(source: Path, path: Path, text: str) -> None:
    with av.open(str(source)) as old, av.open(str(path), "w", format="matroska") as new:
        streams = []
        for stream in old.streams.video:
            streams.append(new.add_stream_from_template(stream, opaque=True))
            streams[-1].time_base = Fraction(1, 1000)
        new.metadata[TAG] = text.replace("\0", "")
        times = [itertools.count(-4) for _ in streams]
        for packet in old.demux(*old.streams.video):
            if packet.size:
                number = packet.stream.index
                packet.dts = next(times[number]) * 40
                packet.stream = streams[number]
                new.mux(packet)


def targets() -> list[Target]:
    # Not portable: the files depend on this machine's encoder.
    stores = [
        Target(f"store {name}", partial(store_seeds, name), damaged_bytes,
               partial(judge_store, name), portable=False)
        for name in CODECS
    ]  # fmt: skip
    return [*stores, Target("metadata", metadata_seeds, damaged_json, judge_metadata)]
