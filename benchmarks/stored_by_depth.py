"""Stored light fields against the true picture: python -m benchmarks.stored_by_depth --out FILE.csv

The thesis's recipe, N = 512 lens samples and pictures of as many pixels as its views, against few
lens samples of more pixels with the depth of every ray, as views and as macropixels: bytes, the
encoder's processor seconds and the PSNR of the worst of five planes, through the whole square lens,
against the average over pixel and lens.

N = 512 is taken from the published run of the tables (benchmarks/published/tables_m128.csv), or
measured with the others by --thesis, which takes minutes per scene.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from benchmarks.publish import RESULTS, Result, of_this_run, read_result
from lfcore.api import load_scene
from lfcore.evaluation.true_picture import Reference, true_pictures
from lfcore.lightfield import LightField
from lfcore.optics.lattice import Lattice
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.rendering.depth import dioptre_range
from lfcore.rendering.prepared import open_tracers
from lfcore.rendering.record import TILE_RAYS
from lfcore.rendering.record_depth import RANGE_MARGIN, DepthStore, frames_by_depth
from lfcore.storage.codecs import Encoding
from lfcore.storage.container import DepthSegments, join_segments
from lfcore.storage.defaults import chosen_encoding, frame_layout
from lfcore.storage.depth_stream import DepthCodes
from lfcore.storage.layout import FrameLayout
from lfcore.storage.segment import SegmentWriter
from lfcore.timing import Stopwatch
from lfcore.tracing.tracer import Tracer

SCENES = Path(__file__).resolve().parents[1] / "scenes"
TRUTH = Lattice(8, 4), Lattice(6, 5)
VIEWS, MACROPIXELS = "views", "macropixels"
CASES = [
    # lens samples and rays per pixel, both per side; layout; displaced; CRFs
    (4, 1.5, VIEWS, True, (16, 20)),
    (4, 2, VIEWS, True, (16, 20, 24)),
    (4, 2, VIEWS, False, (20,)),
    (4, 2, MACROPIXELS, True, (20,)),
    (4, 4, VIEWS, True, (20,)),
    (6, 2, VIEWS, True, (20,)),
    (8, 2, VIEWS, True, (20, 24)),
    (8, 2, MACROPIXELS, True, (20,)),
    (16, 2, VIEWS, True, (20,)),
    (16, 2, MACROPIXELS, True, (20,)),
]
THESIS_VIEWS = 512


class Encoder:
    """Segments of one stream, and the processor seconds that they took."""

    def __init__(self, folder: Path, name: str, layout: FrameLayout, spec: Encoding):
        self.folder, self.name, self.layout, self.spec = folder, name, layout, spec
        self.files: list[Path] = []
        self._watch = Stopwatch(clock=time.process_time)

    def tile(self, frames: Iterable[np.ndarray]) -> None:
        """Encode a tile; the time to make ``frames`` is not counted."""
        self.files.append(self.folder / f"{self.name}{len(self.files)}.mp4")
        size = self.layout.frame_width, self.layout.frame_height
        with self._watch.part("encode"), SegmentWriter(self.files[-1], self.spec, *size) as writer:
            for some in self._watch.each("made", frames):
                writer.write(some)

    @property
    def seconds(self) -> float:
        return self._watch.seconds["encode"] - self._watch.seconds["made"]


def thesis(tracer: Tracer, reference: Reference) -> Iterator[dict]:
    """N = 512 with its defaults, retrieved by the nearest pixel."""
    pixels = reference.pictures.shape[1]
    slab = Slab(tracer.scene.camera, THESIS_VIEWS, pixels)
    spec = chosen_encoding(THESIS_VIEWS)
    layout = frame_layout(THESIS_VIEWS, pixels, spec.stored_format)
    tiles = layout.tiles(TILE_RAYS, least=2)
    with tempfile.TemporaryDirectory() as name:
        encoder = Encoder(Path(name), "", layout, spec)
        for tile in tiles:
            encoder.tile(chunk.frames for chunk in tracer.trace_tile(slab, tile))
        yield _row(
            tracer, reference, layout, tiles, slab, [encoder], spec.crf, f"{THESIS_VIEWS} x 1"
        )


def published(name: str, pixels: int) -> Iterator[dict]:
    """The same from the published tables, if they have this size."""
    file = RESULTS / f"tables_m{pixels}.csv"
    if not file.exists():
        return
    rows = read_result(file).rows
    for row in rows[(rows.scene == name) & (rows.N == str(THESIS_VIEWS))].to_dict("records"):
        rays = (THESIS_VIEWS * pixels) ** 2
        yield {
            "scene": name, "layout": MACROPIXELS, "lattice": f"{THESIS_VIEWS} x 1",
            "views": "plain", "CRF": f"{chosen_encoding(THESIS_VIEWS).crf:g}",
            "bytes": round(12 * rays / float(row["ratio to 12 bytes per ray"])), "of depth": 0,
            "encode s": float(row["encode s"]), "worst dB": None, "planes dB": "",
        }  # fmt: skip


def few(tracer: Tracer, reference: Reference, cases: list) -> Iterator[dict]:
    """Lattices with depth: each is traced once and encoded at every CRF."""
    pixels = reference.pictures.shape[1]
    for views, subpixels, kind, displaced, crfs in cases:
        count = Lattice(views, subpixels)
        slab = Slab(tracer.scene.camera, views, count.side(pixels))
        codes = DepthCodes.of_range(slab, *dioptre_range(tracer, slab, RANGE_MARGIN))
        spec = chosen_encoding(views, by_depth=True)
        layout = frame_layout(views, slab.pixels, spec.stored_format, kind=kind)
        tiles = layout.tiles(slab.rays, least=1)
        made = list(
            frames_by_depth(
                tracer, slab, DepthStore(layout, spec, displaced, pixels), codes, tiles[0]
            )
        )
        for crf in crfs:
            own = chosen_encoding(views, Encoding(crf=float(crf)), by_depth=True)
            grey = FrameLayout(**layout.to_json() | {"pixel_format": codes.pixel_format})
            with tempfile.TemporaryDirectory() as name:
                encoders = [
                    Encoder(Path(name), "light", layout, own),
                    Encoder(Path(name), "depth", grey, codes.spec(slab)),
                ]
                for number, encoder in enumerate(encoders):
                    encoder.tile(both[number] for both in made)
                depth = DepthSegments(encoders[1].files, codes, displaced, pixels, codes.spec(slab))
                yield _row(tracer, reference, layout, tiles, slab, encoders, crf, str(count), depth)


def _row(tracer, reference, layout, tiles, slab, encoders, crf, lattice, depth=None) -> dict:
    file = encoders[0].folder / "lightfield.mkv"
    described = {"name": tracer.scene.name, "digest": "0" * 64}
    join_segments(
        file, encoders[0].files, tiles, layout, geometry=slab, scene=described,
        spec=encoders[0].spec, depth=depth,
    )  # fmt: skip
    field = LightField.open(file)
    pictures = field.refocus_many(reference.planes, device=tracer.device)
    db = reference.psnr(pictures)
    video = field.metadata.depth
    return {
        "scene": tracer.scene.name,
        "layout": layout.kind,
        "lattice": lattice,
        "views": "crossed" if depth and depth.displaced else "plain",
        "CRF": f"{crf:g}",
        "bytes": file.stat().st_size,
        "of depth": sum(size for size, _ in video.segments) if video else 0,
        "encode s": sum(encoder.seconds for encoder in encoders),
        "worst dB": min(db),
        "planes dB": " / ".join(f"{each:.1f}" for each in db),
    }


def compared(rows: list[dict]) -> list[dict]:
    """The published rows, with ratios to the thesis's recipe for their scene."""
    base = {row["scene"]: row for row in rows if row["lattice"] == f"{THESIS_VIEWS} x 1"}
    out = []
    for row in rows:
        made, other = dict(row), base.get(row["scene"])
        made["of depth"] = f"{row['of depth'] / row['bytes']:.0%}" if row["of depth"] else ""
        for key, digits in (("encode s", 3), ("worst dB", 1)):
            made[key] = "" if row[key] is None else f"{row[key]:.{digits}f}"
        for key, name in (("bytes", "bytes of 512"), ("encode s", "seconds of 512")):
            made[name] = f"1/{other[key] / row[key]:.0f}" if other else ""
        out.append(made)
    return out


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", default=["bike", "cabin", "bedroom"])
    parser.add_argument("--size", type=int, default=128, help="pixels of the pictures (128)")
    parser.add_argument(
        "--thesis", action="store_true", help="measure N = 512, too, which takes minutes"
    )
    parser.add_argument("--out", type=Path, required=True, help="result file, .csv")
    return parser.parse_args()


def main() -> None:
    import pandas as pd

    options, rows = parse(), []
    for name in options.scenes:
        scene = load_scene(SCENES / name)
        tracer = open_tracers(scene)[0]
        planes = [
            SensorPlane(focus, scene.camera.f_number, "square") for focus in scene.focus_distances_m
        ]
        reference = true_pictures(tracer, planes, options.size, TRUTH)
        print(f"{name}: truth known to {reference.known_db.min():.1f} dB", flush=True)
        recipe = thesis(tracer, reference) if options.thesis else published(name, options.size)
        for part in (recipe, few(tracer, reference, CASES)):
            for row in part:
                rows.append(row)
                print(row, flush=True)
    command = f"python -m benchmarks.stored_by_depth --size {options.size}"
    if options.thesis:
        command += " --thesis"
    note = {} if options.thesis else {"note": "Seconds and bytes of N = 512 are of `tables_m128`."}
    Result(of_this_run(command, **note), pd.DataFrame(compared(rows))).write(options.out)


if __name__ == "__main__":
    main()
