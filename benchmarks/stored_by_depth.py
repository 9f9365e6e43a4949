"""Stored light fields against the true picture: python -m benchmarks.stored_by_depth --out FILE.csv

The thesis's recipe, N = 512 lens samples and pictures of as many pixels as its views, against few
lens samples of more pixels with the depth of every ray, as views and as macropixels: bytes, the
encoder's processor seconds and the PSNR of the worst of five planes, through the whole square lens,
against the average over pixel and lens.

N = 512, which the ratios need, is measured only with --thesis: it takes minutes per scene.
"""

import argparse
import itertools
import tempfile
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.measured.scenes import SCENES
from benchmarks.publish import Result, of_this_run
from lfcore.api import load_scene
from lfcore.evaluation.true_picture import Reference, true_pictures
from lfcore.lightfield import LightField
from lfcore.optics.lattice import Lattice
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.rendering.depth import dioptre_range
from lfcore.rendering.prepared import open_tracers
from lfcore.rendering.record import TILE_RAYS
from lfcore.rendering.record_depth import RANGE_MARGIN, depth_store, frames_by_depth
from lfcore.storage.codecs import Encoding
from lfcore.storage.container import DepthSegments, join_segments
from lfcore.storage.defaults import chosen_encoding, frame_layout
from lfcore.storage.depth_stream import DepthCodes
from lfcore.storage.layout import FrameLayout
from lfcore.storage.segment import SegmentWriter
from lfcore.timing import Stopwatch
from lfcore.tracing.tracer import Tracer

TRUTH = Lattice(8, 4), Lattice(6, 5)
VIEWS, MACROPIXELS = "views", "macropixels"
CASES = [
    (Lattice(4, 1.5), VIEWS, (16, 20)),
    (Lattice(4), VIEWS, (16, 20, 24)),
    (Lattice(4, displaced=False), VIEWS, (20,)),
    (Lattice(4), MACROPIXELS, (20,)),
    (Lattice(4, 4), VIEWS, (20,)),
    (Lattice(6), VIEWS, (20,)),
    (Lattice(8), VIEWS, (20, 24)),
    (Lattice(8), MACROPIXELS, (20,)),
    (Lattice(16), VIEWS, (20,)),
    (Lattice(16), MACROPIXELS, (20,)),
]
"""Lattices (two rays per pixel, per side, where they do not say more), layouts and CRFs."""
THESIS_VIEWS = 512


def encoded(file: Path, layout: FrameLayout, spec: Encoding, frames: Iterable[np.ndarray]) -> float:
    """Write a segment; the encoder's processor seconds, without the time to make ``frames``."""
    watch, size = Stopwatch(clock=time.process_time), (layout.frame_width, layout.frame_height)
    with watch.part("encode"), SegmentWriter(file, spec, *size) as writer:
        for some in watch.each("made", frames):
            writer.write(some)
    return watch.seconds["encode"] - watch.seconds["made"]


def thesis(tracer: Tracer, reference: Reference) -> dict:
    """N = 512 with its defaults, retrieved by the nearest pixel."""
    pixels = reference.pictures.shape[1]
    slab, spec = Slab(tracer.scene.camera, THESIS_VIEWS, pixels), chosen_encoding(THESIS_VIEWS)
    layout = frame_layout(THESIS_VIEWS, pixels, spec.stored_format)
    tiles = layout.tiles(TILE_RAYS, least=2)
    with tempfile.TemporaryDirectory() as name:
        files = [Path(name) / f"{tile.index}.mp4" for tile in tiles]
        seconds = sum(
            encoded(file, layout, spec, (some.frames for some in tracer.trace_tile(slab, tile)))
            for file, tile in zip(files, tiles, strict=True)
        )
        return _row(
            tracer, reference, layout, tiles, slab, files, spec, seconds, f"{THESIS_VIEWS} x 1"
        )


def few(tracer: Tracer, reference: Reference) -> Iterator[dict]:
    """Lattices with depth: each is traced once and encoded at every CRF."""
    pixels, camera = reference.pictures.shape[1], tracer.scene.camera
    for lattice, kind, crfs in CASES:
        spec = chosen_encoding(lattice.views, by_depth=True)
        slab, store = depth_store(camera, lattice, pixels, spec, kind=kind)
        codes = DepthCodes.of_range(slab, *dioptre_range(tracer, slab, RANGE_MARGIN))
        tiles = store.layout.tiles(slab.rays, least=1)
        lights, depths = zip(*frames_by_depth(tracer, slab, store, codes, tiles[0]), strict=True)
        grey, deep = replace(store.layout, pixel_format=codes.pixel_format), codes.spec(slab)
        for crf in crfs:
            own = chosen_encoding(lattice.views, Encoding(crf=float(crf)), by_depth=True)
            with tempfile.TemporaryDirectory() as name:
                files = [Path(name) / "light.mp4", Path(name) / "depth.mp4"]
                seconds = encoded(files[0], store.layout, own, lights)
                seconds += encoded(files[1], grey, deep, depths)
                depth = DepthSegments(files[1:], codes, lattice.displaced, pixels, deep)
                yield _row(
                    tracer, reference, store.layout, tiles, slab, files[:1], own, seconds,
                    str(lattice), depth,
                )  # fmt: skip


def _row(tracer, reference, layout, tiles, slab, files, spec, seconds, lattice, depth=None) -> dict:
    file = files[0].with_name("lightfield.mkv")
    described = {"name": tracer.scene.name, "digest": "0" * 64}
    join_segments(
        file, files, tiles, layout, geometry=slab, scene=described, spec=spec, depth=depth
    )
    field = LightField.open(file)
    db = reference.psnr(field.refocus_many(reference.planes, device=tracer.device))
    video = field.metadata.depth
    return {
        "scene": tracer.scene.name,
        "layout": layout.kind,
        "lattice": lattice,
        "views": "crossed" if depth and depth.displaced else "plain",
        "CRF": f"{spec.crf:g}",
        "bytes": file.stat().st_size,
        "of depth": sum(size for size, _ in video.segments) if video else 0,
        "encode s": seconds,
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
            made[key] = f"{row[key]:.{digits}f}"
        for key, name in (("bytes", "bytes of 512"), ("encode s", "seconds of 512")):
            made[name] = f"1/{other[key] / row[key]:.0f}" if other else ""
        out.append(made)
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", default=["bike", "cabin", "bedroom"])
    parser.add_argument("--size", type=int, default=128, help="pixels of the pictures (128)")
    parser.add_argument("--thesis", action="store_true", help="measure N = 512, too: minutes")
    parser.add_argument("--out", type=Path, required=True, help="result file, .csv")
    options = parser.parse_args()
    rows: list[dict] = []
    for name in options.scenes:
        scene = load_scene(SCENES / name)
        tracer = open_tracers(scene)[0]
        planes = [
            SensorPlane(focus, scene.camera.f_number, "square") for focus in scene.focus_distances_m
        ]
        reference = true_pictures(tracer, planes, options.size, TRUTH)
        print(f"{name}: truth known to {reference.known_db.min():.1f} dB", flush=True)
        recipe = [thesis(tracer, reference)] if options.thesis else []
        for row in itertools.chain(recipe, few(tracer, reference)):
            rows.append(row)
            print(row, flush=True)
    command = f"python -m benchmarks.stored_by_depth --size {options.size}"
    command += " --thesis" if options.thesis else ""
    Result(of_this_run(command), pd.DataFrame(compared(rows))).write(options.out)


if __name__ == "__main__":
    main()
