"""Our own methods: visibility alone, and the whole of Algorithm 1."""

import time
from typing import Any

import numpy as np

from benchmarks.measured.sample import Sample, SampledTile
from benchmarks.peers.method import Method, Run, clocked
from lfcore.optics.bundles import macropixels, probe
from lfcore.optics.planes import SensorPlane
from lfcore.tracing.packets import Groups
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
    """Trace, shade, cast shadows and add to ``planes``; seconds are those of the kernels' queue.

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
