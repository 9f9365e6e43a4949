"""Compares the tracer with Embree, in one run on one machine.

    python -m benchmarks.tracer --out tracer.csv
    python -m benchmarks.tracer --scenes bike --views 512 --out bike.csv

Both find the closest triangle and depth of every ray, in turn on the same sampled rays.  See
benchmarks/README.md for the columns and the rules.
"""

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, closing, nullcontext
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.peers.embree_packets import EmbreePackets
from benchmarks.peers.method import Method, SkippedError, core_seconds
from benchmarks.results import parser_of, report, say
from benchmarks.sample import SCENES, Sample, sample_slab
from lfcore.optics.bundles import macropixels
from lfcore.optics.slab import Slab
from lfcore.readers.load import load_scene
from lfcore.rendering.prepared import open_tracer
from lfcore.tracing.packets import Groups
from lfcore.tracing.plan import probe
from lfcore.tracing.tracer import Tracer

NAME = "lfcore"
HITS = "hits, Mrays per core-second"


def visibility(tracer: Tracer, sample: Sample) -> Method:
    """Return our method: ``Tracer.slab_hits`` without the copy to numpy arrays."""
    device, bundles = tracer.device, macropixels(sample.slab, sample.pixels)
    job = tracer.job("HITS", probe(sample.slab))
    memory = [device.empty(4 * sample.rays) for _ in range(2)]
    outputs: dict[str, Any] = dict(zip(("triangle", "depth"), memory, strict=True))

    def work() -> None:
        job.launch(bundles, Groups.of(job.shape, bundles, sample.pixels), **outputs)
        device.queue.finish()

    return Method(
        NAME,
        sample.rays,
        partial(core_seconds, work),
        f"{device.name}, {device.lanes} lanes, {device.threads} threads",
        partial(check_hits, tracer, sample),
    )


def check_hits(tracer: Tracer, sample: Sample) -> tuple[float, float]:
    """Return (share of rays that hit, their mean depth), from ``slab_hits``."""
    triangle, depth = tracer.slab_hits(sample.slab, sample.pixels)
    hit = triangle >= 0
    return float(hit.mean()), float(depth[hit].mean(dtype=np.float64))


def all_rows(options) -> list[dict]:
    rows = []
    for name in options.scenes:
        say(f"building {name}")
        tracer = open_tracer(load_scene(SCENES / name / "scene.yaml", bare=True))
        with embree(tracer) as peer:
            for views in options.views:
                say(f"{name}, N = {views}")
                sample = sample_slab(
                    Slab(tracer.scene.camera, views, options.pixels), options.mrays
                )
                methods = [visibility(tracer, sample), *(peer.methods(sample) if peer else [])]
                facts = {"scene": name, "triangles": tracer.scene.triangle_count, "N": views}
                facts |= {"M": options.pixels, "threads": tracer.device.threads}
                rows += [facts | row for row in measured(methods, options.repeats)]
    return rows


def embree(tracer: Tracer) -> AbstractContextManager[EmbreePackets | None]:
    """Open Embree with the scene; print a message and yield None if it cannot run."""
    try:
        return closing(EmbreePackets(tracer.scene, tracer.device.threads))
    except SkippedError as error:
        say(f"SKIPPED embree: {error}")
        return nullcontext()


def measured(methods: Sequence[Method], repeats: int) -> Iterator[dict]:
    """Yield a row per method; the methods take turns, after a warm-up round."""
    rounds = [[method.run() for method in methods] for _ in range(repeats + 1)]
    for method, seconds in zip(methods, np.median(rounds[1:], axis=0).tolist(), strict=True):
        hits, depth = method.check()
        yield {
            "method": method.name, "sampled_rays": method.rays,
            "mrays_per_core_second": method.rays / seconds / 1e6, "hit_share": hits,
            "mean_depth_m": depth, "note": method.note,
        }  # fmt: skip


def beside_embree(rows: pd.DataFrame) -> pd.DataFrame:
    """Return rates by scene and N: ours, the better of Embree's two kinds of packet, the ratio."""
    rows = rows.set_index(["scene", "N"])

    def fastest(method: str) -> pd.Series:
        rates = rows.mrays_per_core_second[rows.method.str.startswith(method)]
        return rates.groupby(level=["scene", "N"], sort=False).max()

    ours, embree = fastest(NAME), fastest("embree, ")
    both = pd.DataFrame({HITS: ours, "Embree 3": embree, "times Embree": ours / embree})
    return both.dropna().map("{:.3g}".format).reset_index()


def main() -> None:
    parser = parser_of(__doc__, pixels=512)
    parser.add_argument("--views", nargs="+", type=int, default=[16, 64, 512], help="N")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--mrays", type=float, default=16.0, help="million rays to sample")
    options = parser.parse_args()
    if options.repeats < 1:
        parser.error("--repeats must be at least 1")
    rows = pd.DataFrame(all_rows(options))
    report(options.out, "python -m benchmarks.tracer", rows, shown={"": beside_embree(rows)})


if __name__ == "__main__":
    main()
