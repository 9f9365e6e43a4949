"""A grid of views into a light field file."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from lfcore.exchange.grid import ExchangeError, ViewGrid
from lfcore.files import draft_folder
from lfcore.storage.codecs import Encoding
from lfcore.storage.container import join_segments
from lfcore.storage.layout import FrameLayout, Tile
from lfcore.storage.metadata import Metadata
from lfcore.storage.segment import SegmentWriter
from lfcore.storage.ycbcr import frames_from_rgb

SEGMENT_RAYS = 1 << 27


def store_grid(
    path: Path,
    grid: ViewGrid,
    spec: Encoding,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> Metadata:
    """Encode all views of ``grid`` into the light field file ``path``, one a frame.

    Views are read once, one at a time.  ``progress`` is called with (views done, of all).
    Raises :class:`StorageError` when a view or the file fails; no file is left then.
    """
    slab = grid.geometry.slab(grid.columns, grid.rows, grid.width, grid.height)
    layout = FrameLayout("views", slab.views, slab.pixels, pixel_format=spec.stored_format)
    tiles = _tiles(layout, slab.held.views)
    digest, done = hashlib.sha256(), 0
    with draft_folder(path) as folder:
        segments = [folder / f"{tile.index:04d}.mp4" for tile in tiles]
        for tile, segment in zip(tiles, segments, strict=True):
            with SegmentWriter(segment, spec, layout.frame_width, layout.frame_height) as writer:
                for column, row in tile.elements() - np.array(slab.held.views[:2], np.int32):
                    picture = _checked(grid, int(column), int(row))
                    digest.update(np.ascontiguousarray(picture).data)
                    writer.write(_frame(picture, slab.held.pixels, layout))
                    done += 1
                    if progress:
                        progress(done, grid.columns * grid.rows)
        return join_segments(
            path, segments, tiles, layout, geometry=slab, spec=spec, content=_content(grid),
            scene={"name": grid.name, "digest": digest.hexdigest()},
        )  # fmt: skip


def _tiles(layout: FrameLayout, held: tuple[int, int, int, int]) -> list[Tile]:
    column, row, columns, rows = held
    step = max(1, SEGMENT_RAYS // (columns * layout.pixels**2))
    starts = range(0, rows, step)
    return [
        layout.tile(column, row + start, columns, min(step, rows - start), index)
        for index, start in enumerate(starts)
    ]


def _checked(grid: ViewGrid, column: int, row: int) -> np.ndarray:
    picture = grid.read(column, row)
    if picture.shape != (grid.height, grid.width, 3):
        raise ExchangeError(
            f"view ({column}, {row}) is {picture.shape}, not {grid.width} x {grid.height} RGB",
            file=grid.name,
        )
    return picture


def _frame(picture: np.ndarray, held: tuple[int, int, int, int], layout: FrameLayout) -> np.ndarray:
    """One planar frame; beside the picture its last pixels are repeated."""
    left, top, width, height = held
    size = layout.pixels
    around = ((top, size - height - top), (left, size - width - left), (0, 0))
    if picture.dtype == np.uint16:
        picture = picture / np.float32(65535)
    square = np.pad(picture, around, mode="edge")
    return frames_from_rgb(
        square[None], layout.pixel_format, layout.frame_width, layout.frame_height
    )


def _content(grid: ViewGrid) -> dict:
    content: dict = {"source": {"format": grid.format}}
    if grid.notes:
        content["source"]["notes"] = list(grid.notes)
    if grid.geometry.missing:
        known = {key: value for key, value in vars(grid.geometry).items() if value is not None}
        content["metric"] = False
        content["source"] |= known
    if grid.depth_m:
        content["depth_m"] = [float(depth) for depth in grid.depth_m]
    return content
