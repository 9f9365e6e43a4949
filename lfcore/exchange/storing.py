"""A grid of views into a light field file."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from lfcore.exchange.grid import ExchangeError, ViewGrid
from lfcore.storage.codecs import Encoding
from lfcore.storage.metadata import Metadata
from lfcore.storage.views_store import store_views


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
    read = partial(_checked, grid)
    return store_views(
        path, slab, read, spec, name=grid.name, content=_content(grid), progress=progress
    )


def _checked(grid: ViewGrid, column: int, row: int) -> np.ndarray:
    picture = grid.read(column, row)
    if picture.shape != (grid.height, grid.width, 3):
        raise ExchangeError(
            f"view ({column}, {row}) is {picture.shape}, not {grid.width} x {grid.height} RGB",
            file=grid.name,
        )
    return picture


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
