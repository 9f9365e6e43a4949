"""From a tracer to a light field file that holds depth beside the rays, for slicing by depth."""

from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.errors import OpticsError
from lfcore.files import draft_folder
from lfcore.optics.camera import Camera
from lfcore.optics.ray_cells import views_of
from lfcore.optics.size import Pixels, Size
from lfcore.optics.slab import Lattice, Slab
from lfcore.progress import Progress
from lfcore.rendering.by_depth import traced_views
from lfcore.rendering.depth import depth_content, dioptre_range
from lfcore.rendering.record import TILE_RAYS
from lfcore.scene.files import scene_digest
from lfcore.storage.codecs import Encoding
from lfcore.storage.container import DepthSegments, join_segments
from lfcore.storage.defaults import frame_layout
from lfcore.storage.depth_stream import DepthCodes
from lfcore.storage.frame_memory import FrameWriter
from lfcore.storage.layout import FrameLayout, Tile
from lfcore.storage.metadata import Metadata
from lfcore.storage.segment import SegmentWriter
from lfcore.tracing.tracer import Tracer

MACROPIXEL_RAYS = 1 << 26
"""Rays of macropixels at most: all of them are held at a time, 1 GiB."""
RANGE_MARGIN = 0.05
"""Of the range of inverse depths seen by few rays: what all of them see may go beyond it."""


@dataclass(frozen=True)
class DepthStore:
    """How a slab is stored for slicing by depth: whether its views are ``displaced`` within a pixel
    against one another, and the longer side of the pictures that textures are filtered for."""

    layout: FrameLayout
    spec: Encoding
    displaced: bool
    pixels: int


def depth_store(
    camera: Camera,
    lattice: Lattice,
    pixels: Pixels,
    spec: Encoding,
    *,
    kind: str = "views",
    **layout: Any,
) -> tuple[Slab, DepthStore]:
    """The slab of ``lattice``, for pictures of so many pixels, and how it is stored, as
    :func:`lfcore.storage.defaults.frame_layout` takes it."""
    slab = Slab.of(camera, lattice, pixels)
    frames = frame_layout(slab.views, slab.size, spec.stored_format, kind=kind, **layout)
    return slab, DepthStore(frames, spec, lattice.displaced, Size.of(pixels).longer)


def record_by_depth(
    path: str | Path,
    tracer: Tracer,
    slab: Slab,
    store: DepthStore,
    *,
    content: dict | None = None,
    progress: Progress | None = None,
) -> Metadata:
    """Trace ``slab`` and write the light field file ``path``, with a stream of inverse depths, or
    nothing.

    Colour and depth are traced together, by all of the device; they are encoded by a thread each
    meanwhile.  ``content`` is what else is known of it; ``progress`` counts views.
    """
    path, layout, scene = Path(path), store.layout, tracer.scene
    if layout.kind == "macropixels" and slab.rays > MACROPIXEL_RAYS:
        raise OpticsError(
            f"{slab.rays:,} rays are more than are turned into macropixels at a time",
            key="layout", remedy="Store them as views",
        )  # fmt: skip
    # Few views gain more from one another than from cores: no more tiles than must be.
    tiles = layout.tiles(TILE_RAYS, least=1)
    seen = dioptre_range(tracer, slab, RANGE_MARGIN)
    codes = DepthCodes.of_range(slab, *seen)
    spec = codes.spec(slab, lossless=store.spec.lossless)
    with draft_folder(path) as folder:
        colours, depths = (
            [folder / f"{tile.index:04d}.{what}.mp4" for tile in tiles]
            for what in ("colours", "depths")
        )
        for tile in tiles:
            frames = frames_by_depth(tracer, slab, store, codes, tile, progress)
            encode(frames, layout, [(colours[tile.index], store.spec), (depths[tile.index], spec)])
        return join_segments(
            path,
            colours,
            tiles,
            layout,
            geometry=slab,
            scene={"name": scene.name, "digest": scene_digest(scene)},
            spec=store.spec,
            content=depth_content(tracer, slab) | (content or {}),
            depth=DepthSegments(depths, codes, store.displaced, store.pixels, spec),
        )


def encode(
    frames: Iterable[Sequence[np.ndarray]],
    layout: FrameLayout,
    streams: Sequence[tuple[Path, Encoding]],
) -> None:
    """Write segment files side by side, each by a thread of its own, of some ``frames`` of every
    stream at a time; ``layout`` is the first stream's."""
    with ExitStack() as stack:
        writers = []
        for file, spec in streams:
            own = replace(layout, pixel_format=spec.stored_format, peak=None)
            size = own.frame_width, own.frame_height
            writer = stack.enter_context(SegmentWriter(file, spec, *size))
            # One thread each, so that frames stay in order; it ends before its writer does.
            writers.append((stack.enter_context(ThreadPoolExecutor(1)), writer))
        jobs: list[Future[None]] = []
        for some in frames:
            for job in jobs:
                job.result()
            jobs = [
                pool.submit(writer.write, each)
                for (pool, writer), each in zip(writers, some, strict=True)
            ]
        for job in jobs:
            job.result()


def frames_by_depth(
    tracer: Tracer,
    slab: Slab,
    store: DepthStore,
    codes: DepthCodes,
    tile: Tile,
    progress: Progress | None = None,
) -> Iterator[Sequence[np.ndarray]]:
    """Some frames of a tile at a time, in order: colours and depths, (F, frame_bytes) uint8."""
    elements, before = tile.elements(), tile.row * slab.views
    by_views = tile.layout.kind == "views"
    order = elements[:, 1] * slab.views + elements[:, 0] if by_views else None
    views = views_of(slab, displaced=store.displaced)
    rooms: list[FrameWriter] = []
    parts = []
    traced = traced_views(tracer, views, store.pixels, order=order, in_rows=by_views)
    for part, first, light, depth in traced:
        ends = first + depth.shape[1] == slab.size.height
        if progress and ends:
            progress(before + part.stop, slab.views**2)
        if not by_views:
            parts.append((light, depth))
            continue
        if not first:  # frames take turns: those before the last are encoded by now
            old = len(rooms) > 1 and rooms.pop(0)
            count = min(tile.frame_count, len(elements[part]))
            rooms.append(old or FrameWriter(tracer.device, tile, count, codes))
        rooms[-1].write(elements[part], light, depth, first_row=first)
        if ends:
            yield rooms[-1].read()
    if parts:
        light, depth = (np.concatenate(both) for both in zip(*parts, strict=True))
        parts.clear()
        u, v = elements.T
        shape = (len(elements), slab.views, slab.views)
        room = FrameWriter(tracer.device, tile, min(tile.frame_count, len(elements)), codes)
        rays = np.moveaxis(light[:, v, u], 0, 1).reshape(*shape, 3)
        room.write(elements, rays, depth[:, v, u].T.reshape(shape))
        yield room.read()
