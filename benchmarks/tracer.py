"""The tracer against its peers and against itself, in one run on one machine.

    python benchmarks/tracer.py --out tracer.csv
    python benchmarks/tracer.py --scenes bike --views 512 --peers embree --out bike.csv
    python benchmarks/tracer.py --arrays --scenes book sphere --views 16 --peers mitsuba --out a.csv

Compared are visibility (closest triangle and depth of every ray) and Algorithm 1 (interpolated
normals, textures, Blinn-Phong, shadows, five sensor planes), ours and the peers' in turn on the
same sampled rays; or arrays of N x N cameras, one shaded ray per pixel.  See benchmarks/README.md
for the columns and the rules.
"""

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np

from benchmarks.measured.rows import parser_of, report, say
from benchmarks.measured.sample import SCENES, Sample, SampledTile, sample_slab
from benchmarks.peers.embree_packets import EmbreePackets
from benchmarks.peers.method import Method, SkippedError, core_seconds
from benchmarks.peers.mitsuba_picture import MitsubaPicture
from lfcore.optics.array import CameraArray
from lfcore.optics.bundles import macropixels
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.rendering.photograph import trace_array
from lfcore.rendering.prepared import open_tracer
from lfcore.scene.build import build_scene
from lfcore.tracing.packets import Groups
from lfcore.tracing.plan import probe
from lfcore.tracing.tracer import Tracer
from lfcore.workflow.studies import ARRAYS

NAME = "lfcore"


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
        sample.rays,
        partial(core_seconds, work),
        f"{device.name}, {device.lanes} lanes, {device.threads} threads",
        partial(check_hits, tracer, sample),
    )


def check_hits(tracer: Tracer, sample: Sample) -> tuple[float, float]:
    """(share of rays that hit, their mean depth), from ``slab_hits``."""
    triangle, depth = tracer.slab_hits(sample.slab, sample.pixels)
    hit = triangle >= 0
    return float(hit.mean()), float(depth[hit].mean(dtype=np.float64))


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
    """Trace, shade, cast shadows and add to ``planes``; seconds are of the kernels' queue, without
    the fixed cost of a tile, of which the sample is a small part."""
    tile = SampledTile.of(sample)

    def work() -> float:
        ends: list[float] = []
        tracing = tracer.trace_tile(
            sample.slab,
            tile,
            planes,
            frames=False,
            progress=lambda done, total: ends.append(time.process_time()),
        )
        begun = time.process_time()
        for _ in tracing:
            pass
        return ends[-1] - begun

    note = f"{tracer.device.name}, {len(planes)} planes"
    return Method(NAME, "algorithm1", sample.rays, work, note)


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
            methods = list((of_array if options.arrays else of_slab)(tracer, views, options, peers))
            facts = {"scene": name, "triangles": tracer.scene.triangle_count, "N": views}
            facts |= {"M": options.pixels, "threads": tracer.device.threads}
            rows += [facts | row for row in measured(methods, options.repeats)]
        for opened in peers.values():
            opened.close()
    return rows


def of_slab(tracer: Tracer, views: int, options, peers: dict[str, Any]) -> Iterator[Method]:
    sample = sample_slab(Slab(tracer.scene.camera, views, options.pixels), options.mrays)
    yield visibility(tracer, sample)
    yield algorithm1(tracer, sample, planes_of(tracer.scene))
    for name, peer in peers.items():
        with skipping(name):
            yield from peer.methods(sample)


def of_array(tracer: Tracer, views: int, options, peers: dict[str, Any]) -> Iterator[Method]:
    grid = ARRAYS[tracer.scene.name]
    size = (views,) * 2, (options.pixels,) * 2
    array = CameraArray.on_grid(size[0], grid["bounds_m"], grid["fov_deg"], size[1])
    work = partial(core_seconds, partial(trace_array, tracer, array))
    yield Method(NAME, "array", array.rays, work)
    if "mitsuba" in peers:
        with skipping("mitsuba"):
            yield peers["mitsuba"].of_array(array)


def measured(methods: Sequence[Method], repeats: int) -> Iterator[dict]:
    """A row per method; methods that do the same work take turns, after a round unseen."""
    for work in dict.fromkeys(method.work for method in methods):
        chosen = [method for method in methods if method.work == work]
        rounds = [[method.run() for method in chosen] for _ in range(repeats + 1)]
        for method, seconds in zip(chosen, np.median(rounds[1:], axis=0).tolist(), strict=True):
            hits, depth = method.check() or (None, None)
            yield {
                "method": method.name, "work": work, "sampled_rays": method.rays,
                "mrays_per_core_second": method.rays / seconds / 1e6, "hit_share": hits,
                "mean_depth_m": depth, "note": method.note,
            }  # fmt: skip


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    parser = parser_of(__doc__, pixels=512)
    parser.add_argument("--views", nargs="+", type=int, default=[16, 64, 512], help="N")
    parser.add_argument("--peers", nargs="*", default=list(PEERS), choices=PEERS)
    parser.add_argument("--arrays", action="store_true", help="of N x N cameras of M x M pixels")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--mrays", type=float, default=16.0, help="million rays to sample")
    options = parser.parse_args(arguments)
    if options.repeats < 1:
        parser.error("--repeats must be at least 1")
    return options


def main() -> None:
    options = parse()
    report(options.out, "python benchmarks/tracer.py", all_rows(options))


if __name__ == "__main__":
    main()
