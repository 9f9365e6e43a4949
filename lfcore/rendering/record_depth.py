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
from lfcore.opencl.device import Device, build_program, cl
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
from lfcore.tracing.chunks import FrameMemory
from lfcore.tracing.header import header
from lfcore.tracing.layouts import BLOCK, PLACEMENT
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
    elements, before = tile.elements(), tile.row * slab.views
    by_views = tile.layout.kind == "views"
    order = elements[:, 1] * slab.views + elements[:, 0] if by_views else None
    views = views_of(slab, displaced=store.displaced)
    rooms: list[_Frames] = []
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
            rooms.append(old or _Frames(tracer.device, tile, codes, elements[part]))
        rooms[-1].write(elements[part], first, light, depth)
        if ends:
            yield rooms[-1].read()
    if parts:
        light, depth = (np.concatenate(both) for both in zip(*parts, strict=True))
        parts.clear()
        u, v = elements.T
        shape = (len(elements), slab.views, slab.views)
        room = _Frames(tracer.device, tile, codes, elements)
        rays = np.moveaxis(light[:, v, u], 0, 1).reshape(*shape, 3)
        room.write(elements, 0, rays, depth[:, v, u].T.reshape(shape))
        yield room.read()


class _Frames:
    """Memory of the frames of some elements of a tile, in which a kernel writes their colours and
    depths; what none covers is black."""

    def __init__(self, device: Device, tile: Tile, codes: DepthCodes, elements: np.ndarray):
        layout, self._device, self._codes = tile.layout, device, codes
        grey = replace(layout, pixel_format=codes.pixel_format, peak=None)
        count = min(tile.frame_count, len(elements))
        self._parts = [
            (each, FrameMemory(device, each.layout, count))
            for each in (tile, replace(tile, layout=grey))
        ]
        code = "uchar" if codes.format.bits == 8 else "ushort"
        defines: dict[str, object] = {"OUTER": 1, "BITS": layout.format.bits, "CODE": code}
        defines |= {"PEAK": layout.peak or 0, "LAST_CODE": codes.last}
        program = build_program(device, ["rendering/kernels/encode.cl"], defines, header())
        self._kernel = cl.Kernel(program, "encode_rows")

    def write(
        self, elements: np.ndarray, first_row: int, light: np.ndarray, depth: np.ndarray
    ) -> None:
        """Write rows of elements, of linear light and metres."""
        device, codes, (count, rows, columns) = self._device, self._codes, depth.shape
        strips, targets = -(-rows // BLOCK), list[Any]()
        for tile, memory in self._parts:
            placed = np.zeros(count, PLACEMENT)
            placed["frame"], placed["x"], placed["y"] = tile.placement(elements).T
            placed["frame"] -= placed["frame"].min()
            targets += [memory.arguments, device.buffer(placed), memory.buffer]
        light, depth = (np.ascontiguousarray(each) for each in (light, depth))
        steps = codes.last / (codes.near - codes.far)
        self._kernel(
            device.queue, (strips, count), (1, 1), device.shown(light), device.shown(depth),
            *map(np.int32, (columns, rows, first_row)), *targets,
            np.float32(codes.far), np.float32(steps), device.empty(12 * BLOCK**2 * strips * count),
        )  # fmt: skip
        device.queue.finish()
        self.count = placed["frame"].max() + 1

    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """Colours and depths, (F, frame_bytes) uint8."""
        colours, depths = (memory.held(self.count) for _, memory in self._parts)
        return colours, depths
