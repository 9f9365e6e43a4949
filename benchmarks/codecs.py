"""Encoder settings for macropixels and views: bits, error and speed, on one core.

    python benchmarks/codecs.py --scenes bike cabin bedroom --views 16 64 512 --out codecs.csv

The material is traced in each pixel format: patches of pixels spread over the picture of each
scene, or with ``--kind views`` up to 16 x 16 views from the middle of the lens (error then is that
of their mean).  Errors are against the same rays in 4:4:4 of 10 bits.
For each setting every patch is one segment, encoded through SegmentWriter and decoded through
SegmentReader, one thread each; seconds are CPU seconds of the process, so that other programs
disturb them little.  Columns: bits a ray (of the packets), PSNR of the frames (RGB, sRGB-encoded),
PSNR of the picture that the whole lens gives and of the one that its middle quarter (a sixteenth
of the area) gives, both in focus, and million rays a second of encoding and decoding.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.measured.rows import write_csv
from lfcore.colour import srgb_decode, srgb_encode
from lfcore.errors import StorageError
from lfcore.optics.slab import Slab
from lfcore.storage.codecs import CodecSpec
from lfcore.storage.layout import FrameLayout, Tile
from lfcore.storage.pixels import pixel_format
from lfcore.storage.segment import SegmentReader, SegmentWriter
from lfcore.storage.ycbcr import rgb_from_frames, ycbcr_to_rgb
from lfcore.timing import Stopwatch

ROOT = Path(__file__).resolve().parents[1]
SPOTS = ((0.2, 0.3), (0.45, 0.55), (0.65, 0.75))
"""Corners of the patches, as fractions of the picture."""
TRUTH = "yuv444p10le"
COMPARED_RAYS = 2_000_000
"""Of each patch: enough for the decibels, and encoding stays the larger part of the time."""
COLUMNS = (
    "scene", "views", "variant", "codec", "pixel_format", "crf", "bits_per_ray", "psnr_frames",
    "psnr_lens", "psnr_quarter", "encode_mrays", "decode_mrays",
)  # fmt: skip


@dataclass(frozen=True)
class Patch:
    """A rectangle of elements: ``cells`` (rows, columns, n, n, 3) uint16 are YCbCr of ``TRUTH``."""

    corner: tuple[int, int]
    cells: np.ndarray

    def tile(self, layout: FrameLayout) -> Tile:
        rows, columns = self.cells.shape[:2]
        return layout.tile(*self.corner, columns, rows)


class Material:
    """Patches of about ``mrays`` million rays in all, in any layout and pixel format, each as the
    tracer makes it; what a setting loses, rounding to its codes included, is against ``TRUTH``."""

    def __init__(self, scene_name: str, kind: str, views: int, pixels: int, mrays: float):
        from lfcore.scene.build import build_scene
        from lfcore.tracing.bvh import build_bvh
        from lfcore.tracing.tracer import Tracer

        scene = build_scene(ROOT / "scenes" / scene_name / "scene.yaml")
        self._tracer = Tracer(scene, build_bvh(scene.triangles))
        self._slab = Slab(scene.camera, views, pixels)
        self._traced: dict[FrameLayout, list[np.ndarray]] = {}
        layout = FrameLayout(kind, views, pixels, "raster", 1, TRUTH)
        self.patches = [
            Patch(corner, self._cells(layout.tile(*corner, *size)))
            for corner, size in places(kind, views, pixels, mrays)
        ]

    def _cells(self, tile: Tile) -> np.ndarray:
        layout, n = tile.layout, tile.layout.inner
        frames = self._trace(tile)
        planes = layout.format.views(frames, layout.frame_width, layout.frame_height)
        codes = np.stack([plane[:, :n, :n] for plane in planes], -1)
        return codes.reshape(tile.rows, tile.columns, n, n, 3)

    def _trace(self, tile: Tile) -> np.ndarray:
        chunks = self._tracer.trace_tile(self._slab, tile)
        return np.concatenate([chunk.frames.copy() for chunk in chunks])

    def frames(self, layout: FrameLayout) -> list[np.ndarray]:
        """(F, frame_bytes) uint8 of each patch; traced once, kept for further settings."""
        if layout not in self._traced:
            self._traced[layout] = [self._trace(patch.tile(layout)) for patch in self.patches]
        return self._traced[layout]


def places(kind: str, views: int, pixels: int, mrays: float) -> list[tuple]:
    """(corner, (columns, rows)) of each patch, in elements."""
    if kind == "views":
        side = min(views, 16)
        return [(((views - side) // 2,) * 2, (side, side))]
    high = int(np.sqrt(mrays * 1e6 / len(SPOTS) / views**2 / 4)) // 8 * 8
    high = min(max(4, high), pixels // 8 // 8 * 8)
    wide = 4 * high
    corners = [tuple(min(int(x * pixels), pixels - wide) // 8 * 8 for x in spot) for spot in SPOTS]
    return [(corner, (wide, high)) for corner in corners]


class Errors:
    """Squared errors of the frames' RGB, and the pictures that both sides give in focus."""

    def __init__(self, kind: str):
        self.kind, self.square, self.count = kind, 0.0, 0
        # Of truth and found by the whole lens, of truth and found by its quarter.
        self.pictures: list[list] = [[], [], [], []]
        self.counts: dict[int, int] = {}

    def add(self, truth: np.ndarray, found: np.ndarray, central: bool) -> None:
        """Two elements (n, n, 3) float32 sRGB; ``central`` is a view in the middle quarter."""
        self.square += float(np.square(truth - found, dtype=np.float64).sum())
        self.count += truth.size
        n = len(truth)
        quarter = slice(n * 3 // 8, n * 3 // 8 + max(1, n // 4))
        for side, picture in enumerate((truth, found)):
            cell = srgb_decode(picture)
            if self.kind == "macropixels":
                self.pictures[side].append(cell.mean((0, 1), dtype=np.float64))
                part = cell[quarter, quarter].mean((0, 1), dtype=np.float64)
                self.pictures[side + 2].append(part)
                continue
            for at in (side, side + 2)[: 2 if central else 1]:
                self.pictures[at] = [cell + (self.pictures[at][0] if self.pictures[at] else 0.0)]
                self.counts[at] = self.counts.get(at, 0) + 1

    def psnr(self) -> tuple[float, float, float]:
        """Of frames, of the whole lens, of its middle quarter; decibels."""
        sides = [np.array(each) for each in self.pictures]
        if self.kind == "views":
            sides = [each / self.counts[at] for at, each in enumerate(sides)]
        wide, wide_found, narrow, narrow_found = (srgb_encode(each) for each in sides)
        squares = (
            self.square / self.count,
            np.square(wide - wide_found).mean(),
            np.square(narrow - narrow_found).mean(),
        )
        frames, lens, middle = (round(float(-10 * np.log10(each + 1e-12)), 2) for each in squares)
        return frames, lens, middle


def measure(material: Material, layout: FrameLayout, spec: CodecSpec) -> tuple:
    """bits a ray, three PSNR, encoding and decoding rate."""
    size = layout.frame_width, layout.frame_height
    bits = rays = 0
    errors, watch = Errors(layout.kind), Stopwatch(clock=time.process_time)
    for patch, frames in zip(material.patches, material.frames(layout), strict=True):
        tile = patch.tile(layout)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "segment.mp4"
            with watch.part("encode"), SegmentWriter(path, spec, *size) as writer:
                writer.write(frames)
            reader = SegmentReader(path)
            with watch.part("decode"):
                decoded = np.concatenate(list(reader.frames()))
            bits += reader.info().bytes * 8
        rays += tile.rays
        compare(patch, tile, decoded, errors)
    rates = (round(rays / watch.seconds[part] / 1e6, 1) for part in ("encode", "decode"))
    return (round(bits / rays, 5), *errors.psnr(), *rates)


def compare(patch: Patch, tile: Tile, decoded: np.ndarray, errors: Errors) -> None:
    """Add a fair share of the macropixels of a decoded tile to ``errors``."""
    layout, n = tile.layout, tile.layout.inner
    step = 1 if layout.kind == "views" else max(1, tile.rays // COMPARED_RAYS)
    elements = tile.elements()[::step]
    middle = np.array([tile.column + tile.columns / 2, tile.row + tile.rows / 2]) - 0.5
    last, picture = -1, np.empty(0)
    for (u, v), (frame, x, y) in zip(elements, tile.placement(elements), strict=True):
        if frame != last:
            one = decoded[frame : frame + 1]
            args = (layout.pixel_format, layout.frame_width, layout.frame_height)
            last, picture = frame, rgb_from_frames(one, *args)[0]
        cell = patch.cells[v - tile.row, u - tile.column]
        truth = ycbcr_to_rgb(cell, pixel_format(TRUTH).bits)
        central = max(abs(np.array([u, v]) - middle)) <= tile.columns / 8
        errors.add(truth, picture[y : y + n, x : x + n], central)


def variants(views: int) -> Iterator[tuple[str, dict, dict]]:
    """(name, changes of the codec settings, changes of the layout)."""
    yield "base", {}, {}
    for preset in ("ultrafast", "veryfast", "faster", "medium"):
        yield f"preset {preset}", {"preset": preset}, {}
    for bframes, refs in ((0, 1), (3, 1), (8, 2), (16, 4)):
        yield f"bframes {bframes} refs {refs}", {"bframes": bframes, "refs": refs}, {}
    for gop in (16, 64):
        yield f"gop {gop}", {"gop": gop}, {}
    for order in ("raster", "hilbert"):
        yield f"order {order}", {}, {"order": order}
    for pack in (1, 2, 4, 8):
        if views * pack <= 512:
            yield f"pack {pack}", {}, {"pack": pack}
    yield "4:4:4", {"pixel_format": "yuv444p"}, {}
    for form in ("yuv420p10le", "yuv444p10le"):
        yield f"10 bit {form}", {"pixel_format": form}, {}
    for codec, preset in (("libx265", "ultrafast"), ("libx265", "fast"), ("libsvtav1", "12")):
        yield f"{codec} {preset}", {"codec": codec, "preset": preset}, {}
    yield "lossless", {"codec": "ffv1", "preset": None, "pixel_format": "gbrp"}, {}
    for name, extra in EXTRA.items():
        yield f"x264 {name}", {"extra": extra}, {}


EXTRA = {
    "no lookahead": (("rc-lookahead", "0"), ("sync-lookahead", "0"), ("mbtree", "0")),
    "no mbtree": (("mbtree", "0"),),
    "dia": (("me", "dia"),),
    "hex": (("me", "hex"),),
    "no deblock": (("no-deblock", "1"),),
    "cavlc": (("no-cabac", "1"),),
    "subme 0": (("subme", "0"),),
    "subme 2": (("subme", "2"),),
    "partitions": (("partitions", "i8x8,i4x4,p8x8,b8x8"),),
    "no 8x8dct": (("no-8x8dct", "1"),),
    "merange 64": (("merange", "64"),),
    "deadzone": (("deadzone-inter", "6"), ("deadzone-intra", "6")),
    "weightp": (("weightp", "2"),),
    "qpmin 14": (("qpmin", "14"),),
    "trellis": (("trellis", "1"),),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scenes", nargs="+", default=["bike", "cabin", "bedroom"])
    parser.add_argument("--views", type=int, nargs="+", default=[16, 64, 512], metavar="N")
    parser.add_argument("--kind", choices=("macropixels", "views"), default="macropixels")
    parser.add_argument("--pixels", type=int, default=512, metavar="M")
    parser.add_argument("--crf", type=float, nargs="+", default=[16, 22])
    parser.add_argument("--preset", default="superfast", help="of libx264, where not varied")
    parser.add_argument("--extra", nargs="*", default=[], metavar="KEY=VALUE", help="for libx264")
    parser.add_argument("--pack", type=int, default=1)
    parser.add_argument("--mrays", type=float, default=12.0, help="million rays of material")
    parser.add_argument("--only", nargs="+", help="variants whose name has one of these words")
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    extra = tuple(tuple(pair.split("=", 1)) for pair in args.extra)
    rows: list[dict] = []
    for scene in args.scenes:
        for views in args.views:
            material = Material(scene, args.kind, views, args.pixels, args.mrays)
            for name, codec, how in variants(views):
                if args.only and not any(word in name for word in args.only):
                    continue
                settings = {"preset": args.preset, "extra": extra} | codec
                if settings.get("codec"):
                    settings["extra"] = ()
                elif "extra" in codec:
                    settings["extra"] = tuple((dict(extra) | dict(codec["extra"])).items())
                for crf in args.crf if codec.get("codec") != "ffv1" else args.crf[:1]:
                    spec = CodecSpec(**settings, crf=crf)
                    place = {"pack": args.pack, "pixel_format": spec.pixel_format} | how
                    layout = FrameLayout(args.kind, views, args.pixels, **place)
                    found = measure(material, layout, spec)
                    row = (scene, views, name, spec.codec, spec.pixel_format, crf, *found)
                    rows.append(dict(zip(COLUMNS, row, strict=True)))
                    write_csv(args.out, rows)
                    print("{:8} {:4} {:22} {:9} {:11}".format(*row[:5]),
                          *(f"{value:>9}" for value in row[5:]), flush=True)  # fmt: skip


if __name__ == "__main__":
    try:
        main()
    except StorageError as error:
        sys.exit(str(error))
