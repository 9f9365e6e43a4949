"""Recording of a light field file with depth beside the rays, for slicing by depth."""

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
from lfcore.refocus.two_parts import one_part
from lfcore.rendering.by_depth import traced_views
from lfcore.rendering.depth import depth_content, dioptre_range, virtual_range
from lfcore.rendering.record import TILE_RAYS
from lfcore.scene.files import scene_digest
from lfcore.storage.codecs import Encoding
from lfcore.storage.container import DepthSegments, SpecularSegments, join_segments
from lfcore.storage.defaults import frame_layout
from lfcore.storage.depth_stream import DepthCodes
from lfcore.storage.frame_memory import FrameWriter
from lfcore.storage.layout import FrameLayout, Tile
from lfcore.storage.metadata import Metadata
from lfcore.storage.segment import SegmentWriter
from lfcore.tracing.tracer import Tracer

MACROPIXEL_RAYS = 1 << 26
"""The most rays of macropixels: all of them are in memory at a time, 1 GiB."""
RANGE_MARGIN = 0.05
"""The share by which the range of inverse depths of a few rays is widened: other rays may exceed
it."""


@dataclass(frozen=True)
class DepthStore:
    """How a slab is stored for slicing by depth.

    Attributes
    ----------
    layout : FrameLayout
        The frames.
    spec : Encoding
        The encoding of colours.
    displaced : bool
        Whether views are displaced within a pixel against one another.
    pixels : int
        The longer side of the pictures that textures are filtered for.
    """

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
    """The slab of ``lattice`` for pictures of ``pixels``, and how it is stored.

    Keywords are those of :func:`lfcore.storage.defaults.frame_layout`.
    """
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

    Colour and depth are traced together, on the whole device; meanwhile two threads encode them.
    ``content`` has further facts for the file; ``progress`` counts views.
    """
    path, layout, scene = Path(path), store.layout, tracer.scene
    if layout.kind == "macropixels" and slab.rays > MACROPIXEL_RAYS:
        raise OpticsError(
            f"{slab.rays:,} rays are too many for macropixels; at most {MACROPIXEL_RAYS:,} fit",
            key="layout", remedy="Store them as views",
        )  # fmt: skip
    # As few tiles as possible: encoders gain more from similar views than from cores.
    tiles = layout.tiles(TILE_RAYS, least=1)
    codes = codes_of_parts(tracer, slab)
    specs = [code.spec(slab, lossless=store.spec.lossless) for code in codes]
    encodings = [each for spec in specs for each in (store.spec, spec)]
    with draft_folder(path) as folder:
        streams = [
            [folder / f"{tile.index:04d}.{stream}.mp4" for tile in tiles]
            for stream in range(len(encodings))
        ]
        for tile in tiles:
            frames = frames_by_depth(tracer, slab, store, codes, tile, progress)
            files = [stream[tile.index] for stream in streams]
            encode(frames, layout, list(zip(files, encodings, strict=True)))
        colours, depths = streams[::2], [
            DepthSegments(files, code, store.displaced, store.pixels, spec)
            for files, code, spec in zip(streams[1::2], codes, specs, strict=True)
        ]  # fmt: skip
        return join_segments(
            path,
            colours[0],
            tiles,
            layout,
            geometry=slab,
            scene={"name": scene.name, "digest": scene_digest(scene)},
            spec=store.spec,
            content=depth_content(tracer, slab) | (content or {}),
            depth=depths[0],
            specular=SpecularSegments(colours[1], store.spec, depths[1]) if codes[1:] else None,
        )


def codes_of_parts(tracer: Tracer, slab: Slab) -> list[DepthCodes]:
    """The codes of surfaces' depths, and if there are specular surfaces, of virtual depths."""
    codes = [DepthCodes.of_range(slab, *dioptre_range(tracer, slab, RANGE_MARGIN))]
    if tracer.needs.specular:
        virtual = virtual_range(tracer, slab, RANGE_MARGIN)
        codes.append(DepthCodes.of_range(slab, *virtual, gaps=True))
    return codes


def encode(
    frames: Iterable[Sequence[np.ndarray]],
    layout: FrameLayout,
    streams: Sequence[tuple[Path, Encoding]],
) -> None:
    """Write segment files in parallel, a thread per file.

    ``frames`` yields some frames of every stream at a time; ``layout`` is the first stream's.
    """
    with ExitStack() as stack:
        writers = []
        for file, spec in streams:
            stored = replace(layout, pixel_format=spec.stored_format, peak=None)
            size = stored.frame_width, stored.frame_height
            writer = stack.enter_context(SegmentWriter(file, spec, *size))
            # One thread per writer keeps frames in order; the thread ends before its writer.
            writers.append((stack.enter_context(ThreadPoolExecutor(1)), writer))
        jobs: list[Future[None]] = []
        for batches in frames:
            for job in jobs:
                job.result()
            jobs = [
                pool.submit(writer.write, batch)
                for (pool, writer), batch in zip(writers, batches, strict=True)
            ]
        for job in jobs:
            job.result()


def frames_by_depth(
    tracer: Tracer,
    slab: Slab,
    store: DepthStore,
    codes: Sequence[DepthCodes],
    tile: Tile,
    progress: Progress | None = None,
) -> Iterator[Sequence[np.ndarray]]:
    """Some frames of a tile at a time, in order: colours and depths of each part that ``codes``
    has, (F, frame_bytes) uint8."""
    elements, before = tile.elements(), tile.row * slab.views
    by_views = tile.layout.kind == "views"
    order = elements[:, 1] * slab.views + elements[:, 0] if by_views else None
    views = views_of(slab, displaced=store.displaced)
    rooms: list[list[FrameWriter]] = []
    held = []
    traced = traced_views(tracer, views, store.pixels, order=order, in_rows=by_views)
    for part, first, parts in traced:
        ends = first + parts[0][1].shape[1] == slab.size.height
        if progress and ends:
            progress(before + part.stop, slab.views**2)
        if len(parts) < len(codes):  # nothing specular is seen
            parts.append((np.zeros_like(parts[0][0]), np.zeros_like(parts[0][1])))
        if len(parts) > len(codes):
            parts = [one_part(parts)]
        if not by_views:
            held.append(parts)
            continue
        if not first:  # the memory before the last is free: its frames are encoded
            old = len(rooms) > 1 and rooms.pop(0)
            count = min(tile.frame_count, len(elements[part]))
            rooms.append(old or [FrameWriter(tracer.device, tile, count, each) for each in codes])
        for room, rays in zip(rooms[-1], parts, strict=True):
            room.write(elements[part], *rays, first_row=first)
        if ends:
            yield [stream for room in rooms[-1] for stream in room.read()]
    if held:
        u, v = elements.T
        shape = (len(elements), slab.views, slab.views)
        streams: list[np.ndarray] = []
        for number, code in enumerate(codes):
            light, depth = (
                np.concatenate([parts[number][kind] for parts in held]) for kind in (0, 1)
            )
            room = FrameWriter(tracer.device, tile, min(tile.frame_count, len(elements)), code)
            colours = np.moveaxis(light[:, v, u], 0, 1).reshape(*shape, 3)
            room.write(elements, colours, depth[:, v, u].T.reshape(shape))
            streams += room.read()
        yield streams
