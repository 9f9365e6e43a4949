"""From a tracer to a light field file that holds depth beside the rays, for slicing by depth."""

from __future__ import annotations

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
from lfcore.storage.layout import FrameLayout, Tile
from lfcore.storage.metadata import Metadata
from lfcore.storage.segment import SegmentWriter
from lfcore.storage.ycbcr import bands, frames_from_rgb
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
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Some frames of a tile at a time, in order: colours and depths, (F, frame_bytes) uint8."""
    layout = store.layout
    grey = replace(layout, pixel_format=codes.pixel_format, peak=None)
    deep = replace(tile, layout=grey)
    for elements, light, depth in _traced(tracer, slab, store, tile, progress):
        shown = _in_frames(tile, elements, light)
        coded = np.empty(depth.shape, codes.format.dtype)
        for rows in bands(depth[:, 0].size, depth.shape[1]):
            coded[:, rows] = codes.of_depth(depth[:, rows])
        depths = _in_frames(deep, elements, coded)
        yield (
            frames_from_rgb(shown, layout.pixel_format, encode=layout.encoded),
            depths.reshape(len(depths), -1).view(np.uint8),
        )


def _traced(
    tracer: Tracer,
    slab: Slab,
    store: DepthStore,
    tile: Tile,
    progress: Progress | None,
) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Elements (E, 2), linear light (E, rows, columns, 3) and depths of some whole frames of a tile
    at a time, in their order."""
    layout, views = tile.layout, views_of(slab, displaced=store.displaced)
    elements, done = tile.elements(), 0
    by_views = layout.kind == "views"
    order = elements[:, 1] * slab.views + elements[:, 0] if by_views else None
    parts = []
    for part, light, depth in traced_views(tracer, views, store.pixels, order=order):
        done += len(light)
        if progress:
            progress(tile.row * slab.views + done, slab.views**2)
        if by_views:
            yield elements[part], light, depth
        else:
            parts.append((light, depth))
    if not by_views:
        light, depth = (np.concatenate(both) for both in zip(*parts, strict=True))
        parts.clear()
        u, v = elements.T
        shape = (len(elements), slab.views, slab.views)
        yield (
            elements,
            np.moveaxis(light[:, v, u], 0, 1).reshape(*shape, 3),
            depth[:, v, u].T.reshape(shape),
        )


def _in_frames(tile: Tile, elements: np.ndarray, pictures: np.ndarray) -> np.ndarray:
    """(F, height, width, ...) of the frames whose elements these are; what none covers is 0, and an
    element smaller than its slot repeats its last row and column."""
    layout = tile.layout
    at, x, y = tile.placement(elements).T[..., None, None]
    first, (wide, high) = at.min(), layout.slot
    shape = (at.max() + 1 - first, layout.frame_height, layout.frame_width, *pictures.shape[3:])
    if pictures.shape == shape:
        return pictures
    around = np.subtract(layout.slot, layout.inner)[::-1]
    fill = [(0, 0), *((0, more) for more in around), *[(0, 0)] * (pictures.ndim - 3)]
    frames = np.zeros(shape, pictures.dtype)
    frames[at - first, y + np.arange(high)[:, None], x + np.arange(wide)] = np.pad(
        pictures, fill, mode="edge"
    )
    return frames
