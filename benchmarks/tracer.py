"""The tracer against its peers and against itself, in one run on one machine.

    python benchmarks/tracer.py --out tracer.csv
    python benchmarks/tracer.py --scenes bike --views 512 --peers embree --out bike.csv

Compared are visibility (closest triangle and depth of every ray) and Algorithm 1 (interpolated
normals, textures, Blinn-Phong, shadows, five sensor planes), ours and the peers' in turn on the
same sampled rays; see benchmarks/README.md for the columns and the rules.
"""

import argparse
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.measured.rows import in_turn, rates, report, say
from benchmarks.measured.sample import SCENES, Sample, SampledTile, sample_slab
from benchmarks.peers.embree_packets import EmbreePackets
from benchmarks.peers.method import Method, Run, SkippedError, clocked
from benchmarks.peers.mitsuba_picture import MitsubaPicture
from lfcore.optics.bundles import macropixels
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.rendering.prepared import open_tracer
from lfcore.scene.build import build_scene
from lfcore.tracing.packets import Groups
from lfcore.tracing.plan import probe
from lfcore.tracing.tracer import Tracer

NAME = "lfcore"
CHECKED_RAYS = 1 << 22


def visibility(tracer: Tracer, sample: Sample) -> Method:
    """Closest triangle and depth of every ray, left in the device's memory: ``Tracer.slab_hits``
    without the copy to numpy arrays."""
    device, bundles = tracer.device, macropixels(sample.slab, sample.pixels)
    job = tracer.job("HITS", probe(sample.slab))
    memory = [device.empty(4 * sample.rays) for _ in range(2)]
    outputs: dict[str, Any] = dict(zip(("triangle", "depth"), memory, strict=True))

    def work() -> None:
        job.launch(bundles, Groups.of(job.shape, bundles, sample.pixels), **outputs)
        device.queue.finish()

    return Method(
        NAME,
        "visibility",
        lambda: clocked(work, sample.rays),
        f"{device.name}, {device.lanes} lanes, {device.threads} threads",
        lambda: check_hits(tracer, sample),
        ours=True,
    )


def check_hits(tracer: Tracer, sample: Sample) -> tuple[float, float]:
    """(share of rays that hit, their mean depth), from ``slab_hits``."""
    pixels, hits, depth = sample.pixels, 0, 0.0
    step = max(1, CHECKED_RAYS // sample.slab.views**2)
    for start in range(0, len(pixels), step):
        triangle, z = tracer.slab_hits(sample.slab, pixels[start : start + step])
        seen = triangle >= 0
        hits += int(seen.sum())
        depth += float(z[seen].sum(dtype=np.float64))
    return hits / sample.rays, depth / max(hits, 1)


def planes_of(scene) -> list[SensorPlane]:
    """Five planes over the scene's own focus distances, at the lens's full aperture.

    The first has a square aperture, so that every ray of the slab counts; the others are round.
    """
    near, far = min(scene.focus_distances_m), max(scene.focus_distances_m)
    dioptres = np.linspace(1 / near, 1 / far, 5)
    return [
        SensorPlane(float(1 / d), scene.camera.f_number, "circle" if k else "square")
        for k, d in enumerate(dioptres)
    ]


def algorithm1(tracer: Tracer, sample: Sample, planes: list[SensorPlane]) -> Method:
    """Trace, shade, cast shadows and add to ``planes``; seconds are of the kernels' queue.

    The fixed cost of a tile (accumulators are made and read back) is apart, in
    ``extra["tile_seconds"]``: the sample is a small part of a real tile.
    """
    tile, extra = SampledTile.of(sample), dict[str, list[float]](tile_seconds=[])

    def work() -> Run:
        ends: list[float] = []
        begun = time.perf_counter()
        tracing = tracer.trace_tile(
            sample.slab,
            tile,
            planes,
            frames=False,
            progress=lambda done, total: ends.append(time.process_time()),
        )
        cpu = time.process_time()
        for _ in tracing:
            pass
        extra["tile_seconds"].append(time.perf_counter() - begun - tracing.seconds)
        return Run(tracing.seconds, ends[-1] - cpu, sample.rays)

    note = f"{tracer.device.name}, {len(planes)} planes"
    return Method(NAME, "algorithm1", work, note, ours=True, extra=extra)


PEERS: dict[str, Callable] = {"embree": EmbreePackets, "mitsuba": MitsubaPicture}
"""What makes a peer of a scene and the number of threads."""


@contextmanager
def skipping(name: str) -> Iterator[None]:
    """A line says why a peer cannot run."""
    try:
        yield
    except SkippedError as error:
        say(f"SKIPPED {name}: {error}")


def all_rows(options) -> list[dict]:
    rows = []
    for name in options.scenes:
        say(f"building {name}")
        tracer = open_tracer(build_scene(SCENES / name / "scene.yaml"))
        peers = {}
        for peer in options.peers:
            with skipping(peer):
                peers[peer] = PEERS[peer](tracer.scene, tracer.device.threads)
        for views in options.views:
            say(f"{name}, N = {views}")
            rows += [{"scene": name, **row} for row in _rows(tracer, views, options, peers)]
        for opened in peers.values():
            opened.close()
    return rows


def _rows(tracer: Tracer, views: int, options, peers: dict[str, Any]) -> list[dict]:
    scene = tracer.scene
    sample = sample_slab(Slab(scene.camera, views, options.pixels), options.mrays)
    planes = planes_of(scene)
    methods = [visibility(tracer, sample), algorithm1(tracer, sample, planes)]
    for name, peer in peers.items():
        with skipping(name):
            methods += peer.methods(sample)
    rows = []
    for work in ("visibility", "algorithm1"):
        chosen = [method for method in methods if method.work == work]
        found = {name: rates(runs) for name, runs in in_turn(chosen, options.repeats).items()}
        others = [m for m in chosen if not m.ours]
        for method in chosen:
            row = found[method.name]
            best = max((found[m.name]["mrays_per_second"] for m in others), default=None)
            core = max((found[m.name]["mrays_per_core_second"] for m in others), default=None)
            hits, depth = method.check() or (None, None)
            tiles = method.extra.get("tile_seconds")
            rows.append({
                "triangles": scene.triangle_count,
                "N": views,
                "M": options.pixels,
                "method": method.name,
                "work": work,
                "mrays_per_second": row["mrays_per_second"],
                "ratio_to_best_peer": row["mrays_per_second"] / best if best else None,
                **{key: row[key] for key in row if key != "mrays_per_second"},
                "core_ratio_to_best_peer": row["mrays_per_core_second"] / core if core else None,
                "hit_share": hits,
                "mean_depth_m": depth,
                "tile_seconds": float(np.median(tiles)) if tiles else None,
                "threads": tracer.device.threads,
                "note": method.note,
            })  # fmt: skip
    return rows


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", default=["bike", "cabin", "bedroom"])
    parser.add_argument("--views", nargs="+", type=int, default=[16, 64, 512], help="N")
    parser.add_argument("--pixels", type=int, default=512, help="M; default 512")
    parser.add_argument("--peers", nargs="*", default=list(PEERS), choices=[*PEERS, "none"])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--mrays", type=float, default=16.0, help="million rays to sample")
    parser.add_argument("--out", type=Path, required=True, help="CSV file")
    options = parser.parse_args(arguments)
    options.peers = [peer for peer in options.peers if peer != "none"]
    if options.repeats < 1:
        parser.error("--repeats must be at least 1")
    return options


def main() -> None:
    options = parse()
    report(options.out, lambda: all_rows(options))


if __name__ == "__main__":
    main()
