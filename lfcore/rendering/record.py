"""Recording of a light field file by tracing, in one process (Algorithm 3)."""

import math
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from lfcore.files import draft_folder
from lfcore.optics import bundles
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.progress import Progress
from lfcore.refocus.stored_views import prefetched
from lfcore.rendering.depth import all_samples, depth_content, spread_over
from lfcore.rendering.tiles import TileTracing, trace_tile
from lfcore.scene.files import scene_digest
from lfcore.storage.codecs import Encoding
from lfcore.storage.container import join_segments
from lfcore.storage.layout import FrameLayout, Tile
from lfcore.storage.metadata import Metadata
from lfcore.storage.segment import SegmentWriter
from lfcore.timing import Stopwatch
from lfcore.tracing.tracer import Tracer

TILE_RAYS = 1 << 27
"""The rays of a tile, which becomes a segment of the file."""
HEADROOM = 2.0
"""The largest ratio of the brightest highlight of all rays to that of a few rays."""


def record_slab(
    path: str | Path,
    tracers: Sequence[Tracer],
    slab: Slab,
    layout: FrameLayout,
    spec: Encoding,
    *,
    content: dict | None = None,
    progress: Progress | None = None,
) -> Metadata:
    """Trace ``slab`` and write the light field file ``path``, or nothing.

    Each of the ``tracers`` traces a tile at a time; all have one scene, and a device (queue) each.
    Segments are in a temporary folder beside ``path`` until they are joined.  ``content`` has
    further facts for the file; ``progress`` counts outer elements.
    """
    path, scene = Path(path), tracers[0].scene
    tiles = layout.tiles(TILE_RAYS, least=max(2, len(tracers)))
    free, lock, failed = list(tracers), threading.Lock(), threading.Event()
    traced, total = dict.fromkeys(range(len(tiles)), 0), math.prod(layout.outer)
    with draft_folder(path) as folder:
        segments = [folder / f"{tile.index:04d}.mp4" for tile in tiles]

        def record(tile: Tile) -> None:
            def report(elements: int, _: int) -> None:
                with lock:
                    if failed.is_set():  # another tile failed, or the user interrupted
                        raise _StoppedError
                    traced[tile.index] = elements
                    if progress:
                        progress(sum(traced.values()), total)

            with lock:
                tracer = free.pop()
            try:
                record_tile(tracer, slab, tile, segments[tile.index], spec, progress=report)
            finally:
                free.append(tracer)

        with ThreadPoolExecutor(len(tracers)) as pool:
            jobs = [pool.submit(record, tile) for tile in tiles]
            try:
                for job in jobs:
                    job.result()
            except BaseException:
                failed.set()
                pool.shutdown(cancel_futures=True)
                raise
        return join_segments(
            path,
            segments,
            tiles,
            layout,
            geometry=slab,
            scene={"name": scene.name, "digest": scene_digest(scene)},
            spec=spec,
            content=depth_content(tracers[0], slab) | (content or {}),
        )


def record_tile(
    tracer: Tracer,
    slab: Slab,
    tile: Tile,
    segment: str | Path,
    spec: Encoding,
    planes: Sequence[SensorPlane] = (),
    *,
    progress: Progress | None = None,
) -> tuple[TileTracing, float]:
    """Trace one tile into the file ``segment``.

    Returns the ended tracing, and the seconds of encoding beyond it, by the device's clock.

    A device other than the CPU traces the next frames during encoding; the CPU does not, because
    the encoder needs its core.
    """
    layout, tracing = tile.layout, trace_tile(tracer, slab, tile, planes, progress=progress)
    frames: Iterator[np.ndarray] = (chunk.frames for chunk in tracing)
    if not tracer.device.is_cpu:
        frames = prefetched(chunk.frames.copy() for chunk in tracing)
    watch, size = Stopwatch(clock=tracer.device.clock), (layout.frame_width, layout.frame_height)
    with watch.part("whole"), SegmentWriter(segment, spec, *size) as writer:
        for some in frames:
            writer.write(some)
    return tracing, watch.seconds["whole"] - tracing.seconds


class _StoppedError(Exception):
    """Ends a tile that is being traced."""


def peak_to_store(tracer: Tracer, slab: Slab, transfer: str | None) -> float | None:
    """The radiance of the brightest code, a power of two; None for sRGB, which ends at white.

    Without a ``transfer``, sRGB if no ray is brighter than white.  The radiance of emitters and of
    the background is exact; that of highlights is measured by a few rays, with headroom.
    """
    stops = tracer.needs.stops
    if transfer == "srgb" or (transfer is None and not stops):
        return None
    coarse_rays = bundles.views(coarse := spread_over(slab), all_samples(coarse))
    brightest = float(tracer.bundle_radiance(coarse_rays).max(initial=0.0)) if stops else 1.0
    scene = tracer.scene
    emissions = np.array([max(material.emission) for material in scene.every_material], np.float64)
    x, y, z = np.moveaxis(scene.triangles, -1, 0).astype(np.float64)
    reach = slab.camera.field_width / 2 * max(slab.size) / min(slab.size)
    reach = reach * np.maximum(z, 0) + slab.camera.lens_radius_m
    corners = ((z > 0) & (np.maximum(np.abs(x), np.abs(y)) <= reach)).any(axis=1)
    emitted = float(emissions[scene.material_ids[corners]].max(initial=0.0))
    if transfer is None and max(brightest, emitted) <= 1:
        return None
    most = max(1.0, emitted, HEADROOM * brightest)
    return 2.0 ** min(stops, math.ceil(math.log2(most)))
