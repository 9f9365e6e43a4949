"""Our own methods: visibility alone, and the whole of Algorithm 1."""

from __future__ import annotations

import time

import numpy as np
from peers.method import Method, Run, clocked

from lfcore.opencl.device import Device, cl
from lfcore.optics.planes import SensorPlane
from lfcore.tracing.tracer import Tracer
from measured.sample import Sample, SampledTile

NAME = "lfcore"
CHECKED_RAYS = 1 << 22


class MeasuredTracer(Tracer):
    """A tracer whose launches of visibility can be replayed without what surrounds them.

    While ``launches`` is a list, kernels that would write every ray to memory are built not to,
    and each launch is put on the list.
    """

    launches: list[tuple] | None = None
    defines: dict | None = None

    def _kernel(self, *args):
        if self.launches is None:
            return super()._kernel(*args)
        changed = [{**a, "WRITE": 0} if isinstance(a, dict) and "WRITE" in a else a for a in args]
        self.defines = next(a for a in changed if isinstance(a, dict))
        kernel = super()._kernel(*changed)
        counters = self._counters = []

        def launch(*arguments):
            self.launches.append((kernel, arguments, counters[-1]))
            return kernel(*arguments)

        return launch

    def _counter(self) -> cl.Buffer:
        counter = super()._counter()
        if self.launches is not None:
            self._counters.append(counter)
        return counter

    def record(self, sample: Sample) -> list[tuple]:
        """The launches (kernel, arguments, counter) that find every hit of ``sample``."""
        self.slab_hits(sample.slab, sample.pixels[:1])  # what a block spans is found out once
        self.launches = []
        try:
            self.slab_hits(sample.slab, sample.pixels)
            return self.launches
        finally:
            self.launches = None


def visibility(tracer: MeasuredTracer, sample: Sample) -> Method:
    """Closest triangle and depth of every ray, left in each worker's scratch as Embree leaves
    them in its packet: nothing is written for a later stage."""
    device, launches = tracer.device, tracer.record(sample)

    def work() -> None:
        replay(device, launches)

    return Method(
        NAME,
        "visibility",
        lambda: clocked(work, sample.rays),
        f"{device.name}, {device.lanes} lanes, {device.threads} threads",
        lambda: check_hits(tracer, sample),
        ours=True,
    )


def replay(device: Device, launches: list[tuple], kernel: cl.Kernel | None = None) -> None:
    """Launch again what was recorded, with another ``kernel`` of the same arguments if given."""
    for recorded, arguments, counter in launches:
        cl.enqueue_fill_buffer(device.queue, counter, np.int32(0), 0, 4)
        (kernel or recorded)(*arguments)
    device.queue.finish()


def check_hits(tracer: Tracer, sample: Sample) -> tuple[float, float]:
    """(share of rays that hit, mean depth of those), from what ``slab_hits`` returns."""
    pixels, hits, depth = sample.pixels, 0, 0.0
    step = max(1, CHECKED_RAYS // sample.slab.views**2)
    for start in range(0, len(pixels), step):
        triangle, z = tracer.slab_hits(sample.slab, pixels[start : start + step])
        seen = triangle >= 0
        hits += int(seen.sum())
        depth += float(z[seen].sum(dtype=np.float64))
    return hits / sample.rays, depth / max(hits, 1)


def planes_of(scene, count: int = 5) -> list[SensorPlane]:
    """``count`` planes over the scene's own focus distances, at the lens's full aperture.

    The first has a square opening, so that every ray of the slab counts; the others are round.
    """
    near, far = min(scene.focus_distances_m), max(scene.focus_distances_m)
    dioptres = np.linspace(1 / near, 1 / far, count)
    return [
        SensorPlane(float(1 / d), scene.camera.f_number, "circle" if k else "square")
        for k, d in enumerate(dioptres)
    ]


def algorithm1(tracer: Tracer, sample: Sample, planes: list[SensorPlane]) -> Method:
    """See, shade, cast shadows and add to ``planes``; seconds are of the kernels' queue.

    What a tile costs once, whatever its rays (accumulators made and read back), is kept apart in
    ``extra["tile_seconds"]``: the sample stands for a small part of a real tile.
    """
    tile, extra = SampledTile.of(sample), {"tile_seconds": []}

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
