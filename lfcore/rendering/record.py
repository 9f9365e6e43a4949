"""From a tracer to a light field file, in one process (Algorithm 3)."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from lfcore.files import draft_folder
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.progress import Progress
from lfcore.rendering.depth import depth_content
from lfcore.scene.files import scene_digest
from lfcore.storage.codecs import Encoding
from lfcore.storage.container import join_segments
from lfcore.storage.layout import FrameLayout, Tile
from lfcore.storage.metadata import Metadata
from lfcore.storage.segment import SegmentWriter
from lfcore.timing import Stopwatch
from lfcore.tracing.chunks import Chunk
from lfcore.tracing.tracer import TileTracing, Tracer

TILE_RAYS = 1 << 27


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

    As many tiles at a time as there are ``tracers``, which are of one scene, on devices (queues)
    of their own; segments lie in a temporary folder beside ``path`` until they are joined.
    ``content`` is what else is known of it; ``progress`` counts outer elements.
    """
    path, scene = Path(path), tracers[0].scene
    tiles = layout.tiles(TILE_RAYS, least=max(2, len(tracers)))
    count, lock = _Elements(progress, math.prod(layout.outer)), threading.Lock()
    free = list(tracers)
    with draft_folder(path) as folder:
        segments = [folder / f"{tile.index:04d}.mp4" for tile in tiles]

        def one(tile: Tile) -> None:
            with lock:
                tracer = free.pop()
            try:
                record_tile(
                    tracer, slab, tile, segments[tile.index], spec, progress=count.of_tile()
                )
            finally:
                free.append(tracer)

        with ThreadPoolExecutor(len(tracers)) as pool:
            jobs = [pool.submit(one, tile) for tile in tiles]
            try:
                for job in jobs:
                    job.result()
            except BaseException:
                count.stop()
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
    """Trace one tile into the file ``segment``: the tracing, which has ended, and the wall seconds
    that encoding took beyond it.

    On a device beside the CPU the next frames are traced meanwhile; on the CPU itself that would
    only take the encoder's core from it.
    """
    layout, tracing = tile.layout, tracer.trace_tile(slab, tile, planes, progress=progress)
    frames: Iterator[np.ndarray] = (chunk.frames for chunk in tracing)
    if not tracer.device.is_cpu:
        frames = _copied_ahead(tracing)
    watch, size = Stopwatch(), (layout.frame_width, layout.frame_height)
    with watch.part("whole"), SegmentWriter(segment, spec, *size) as writer:
        for some in frames:
            writer.write(some)
    return tracing, watch.seconds["whole"] - tracing.seconds


class _Stopped(Exception):
    """Another tile failed, or the user interrupted: this one is not wanted any more."""


class _Elements:
    """Adds up the outer elements that several threads have done."""

    def __init__(self, callback: Progress | None, total: int):
        self._callback, self._total, self._done = callback, total, 0
        self._lock, self._stopped = threading.Lock(), False

    def stop(self) -> None:
        """Let tiles that are being traced end where they next report."""
        self._stopped = True

    def of_tile(self) -> Progress:
        """What a tile is to call with (done, of its own)."""
        before = 0

        def report(done: int, _: int) -> None:
            nonlocal before
            with self._lock:
                if self._stopped:
                    raise _Stopped
                self._done += done - before
                before = done
                if self._callback:
                    self._callback(self._done, self._total)

        return report


def _copied_ahead(tracing: Iterable[Chunk]) -> Iterator[np.ndarray]:
    """Frames of a tile, traced by one thread while the other encodes those before."""
    chunks = iter(tracing)

    def following() -> np.ndarray | None:
        chunk = next(chunks, None)
        return None if chunk is None else chunk.frames.copy()

    with ThreadPoolExecutor(1) as pool:
        coming = pool.submit(following)
        while (frames := coming.result()) is not None:
            coming = pool.submit(following)
            yield frames
