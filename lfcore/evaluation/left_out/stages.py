"""Stages and jobs that a configuration can do without: what ``store: false`` saves."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

from lfcore.evaluation.left_out.bench import Bench, same
from lfcore.rendering.record import record_tile
from lfcore.storage import defaults
from lfcore.storage.container import join_segments
from lfcore.storage.layout import FrameLayout
from lfcore.tracing.tracer import Tracer


def stages(bench: Bench) -> Iterator[dict]:
    """Encoding and joining, against forming planes alone."""
    tracer = Tracer(bench.scene, bench.bvh, bench.device)
    planes = [bench.plane]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "lightfield.mkv"
        stored = _store(bench, tracer, planes, file)
        size = file.stat().st_size
        alone = bench.run(tracer, planes, frames=False)[1]
        yield bench.row(
            "stage: store",
            "jobs that encode, join and retrieve, where only pictures are wanted (store: false); "
            "bytes are of the file",
            lambda: _store(bench, tracer, planes, file),
            bench.tracing(tracer, planes, frames=False),
            size,
            same([stored], [alone]),
        )


def _store(bench: Bench, tracer: Tracer, planes, file: Path):
    """Trace, encode and join; the plane sums that were formed on the way."""
    slab = bench.slab
    spec = defaults.default_spec(slab.views)
    layout = FrameLayout("macropixels", slab.views, slab.pixels, pixel_format=spec.pixel_format)
    tile = layout.tile(0, 0, slab.pixels, slab.pixels)
    segment = file.with_name("0.mp4")
    tracing, _ = record_tile(tracer, slab, tile, segment, spec, planes)
    about = {"name": bench.scene.name, "digest": "0" * 64}
    join_segments(file, [segment], [tile], layout, geometry=slab, scene=about, spec=spec)
    return tracing.plane_sums.sums
