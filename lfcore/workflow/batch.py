"""The tracer of a job, and the tracing of several tiles: sums of planes, and segments."""

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

from lfcore.files import draft_folder
from lfcore.opencl.device import open_device
from lfcore.optics.plane_sums import PlaneSums
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.rendering.tiles import trace_tile
from lfcore.scene.baked import BakedLight
from lfcore.scene.files import read_scene
from lfcore.scene.model import Scene
from lfcore.storage.codecs import Encoding
from lfcore.storage.layout import Tile
from lfcore.tracing.bvh import Bvh, load_bvh
from lfcore.tracing.tracer import Tracer


def open_scene(files: Any) -> tuple[Scene, Bvh]:
    """Read the scene ``files.scene``, with its light if ``files.light`` has one, and its BVH."""
    scene = read_scene(files.scene)
    for light in getattr(files, "light", ()):
        scene = replace(scene, light=BakedLight.load(light))
    return scene, load_bvh(files.bvh)


def open_tracer(job: Any, **options: Any) -> Tracer:
    """Open a tracer of a job's scene on its device; ``options`` are :class:`Tracer`'s."""
    device = open_device(job.params.device or None, threads=job.threads)
    return Tracer(*open_scene(job.input), device, **options)


def trace_batch(
    tracer: Tracer,
    slab: Slab,
    tiles: Sequence[Tile],
    planes: Sequence[SensorPlane],
    *,
    segments: str | Path | None,
    spec: Encoding,
) -> tuple[PlaneSums, dict]:
    """Trace tiles one after the other, and store them in the zip file ``segments``, if any.

    Returns the planes' sums over all tiles, and the facts: rays, tiles, core seconds.
    """
    rays, seconds = 0, {"trace": 0.0, "encode": 0.0}
    total: PlaneSums | None = None
    with draft_folder(segments) if segments else nullcontext() as folder:
        files = []
        for tile in tiles:
            if folder is None:
                tracing = trace_tile(tracer, slab, tile, planes, frames=False).finished()
            else:
                from lfcore.rendering.record import record_tile  # loads the codecs

                files.append(folder / f"{tile.index}.mp4")
                tracing, encode = record_tile(tracer, slab, tile, files[-1], spec, planes)
                seconds["encode"] += encode
            rays += tracing.rays
            seconds["trace"] += tracing.seconds
            part = tracing.plane_sums
            total = total.with_part(part) if total and part else part
        if segments:
            from lfcore.storage.container import pack_segments

            pack_segments(segments, files)
    assert total is not None
    return total, {"rays": rays, "tiles": len(tiles), "seconds": seconds}
