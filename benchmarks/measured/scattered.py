"""Blocks traced as packets, or ray by ray: what the tracer's choice between them is measured by."""

from __future__ import annotations

import numpy as np

from benchmarks.measured.costs import race
from benchmarks.measured.rows import say
from benchmarks.measured.scenes import Loaded
from benchmarks.peers.method import Method, clocked
from lfcore.optics.bundles import Bundles, macropixels, views
from lfcore.optics.slab import Slab
from lfcore.tracing.plan import SINGLE_RAY_LEAVES, leaves_a_ray
from lfcore.tracing.tracer import Tracer

CASES = (("macropixels", 16, 512), ("macropixels", 4, 512), ("views", 8, 256), ("views", 8, 64))
"""Inner grid, N and M; views are the data cameras of an array over the lens."""
MOST_RAYS = 1 << 19


def bundles_of(slab: Slab, kind: str) -> tuple[Bundles, np.ndarray]:
    """Whole 4 x 4 cells of elements, spread over the slab, and where they stand."""
    make, size, inner = (
        (macropixels, slab.pixels, slab.views)
        if kind == "macropixels"
        else (views, slab.views, slab.pixels)
    )
    cells = size // 4
    side = max(1, min(cells, int((MOST_RAYS / (16 * inner**2)) ** 0.5)))
    first = 4 * (np.arange(side) * cells // side)
    line = (first[:, None] + np.arange(4)).ravel()
    places = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    return make(slab, places), places


def _method(tracer: Tracer, work: str, bundles: Bundles, places: np.ndarray) -> Method:
    trace = tracer.bundle_hits if work == "visibility" else tracer.bundle_radiance
    rays = len(places) * bundles.columns * bundles.rows

    return Method("", work, lambda: clocked(lambda: trace(bundles, places), rays), ours=True)


def scattered(options) -> list[dict]:
    """Both ways for coarse and fine bundles of each scene; seconds include reading back."""
    rows = []
    for name in options.scenes:
        loaded = Loaded.open(name)
        tracers = {
            way: Tracer(loaded.scene, loaded.bvh, single_rays=way == "rays")
            for way in ("packets", "rays")
        }
        for kind, count, size in CASES:
            say(f"{name}, {kind}, N = {count}, M = {size}")
            bundles, places = bundles_of(Slab(loaded.scene.camera, count, size), kind)
            leaves = leaves_a_ray(loaded.bvh.leaf_boxes, bundles)
            head = {
                "scene": name,
                "triangles": loaded.scene.triangle_count,
                "inner": kind,
                "N": count,
                "M": size,
                "leaves_a_ray": leaves,
                "chosen": "rays" if leaves > SINGLE_RAY_LEAVES else "packets",
            }
            for work in ("visibility", "radiance"):
                methods = {way: _method(t, work, bundles, places) for way, t in tracers.items()}
                rows += race(head, "method", methods, options.repeats)
    return rows
