"""A light field file's views as a lazy xarray.DataArray."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from lfcore.colour import srgb_codes
from lfcore.errors import LfcoreError
from lfcore.refocus.free_views import served_positions, views_at
from lfcore.storage.index import FIRST
from lfcore.storage.lightfield import LightFieldFile

if TYPE_CHECKING:
    import xarray

DIMENSIONS = ("row", "column", "y", "x", "channel")


def labelled_views(field: LightFieldFile, *, codes: bool = False) -> xarray.DataArray:
    """As :meth:`lfcore.LightField.to_xarray`."""
    try:
        import dask.array
        import xarray
    except ImportError as error:
        raise LfcoreError(
            f"an array with named dimensions cannot be made: {error}", file=field.path,
            remedy="pip install 'lfcore[xarray]'",
        ) from None  # fmt: skip
    kind = np.uint8 if codes else np.float32
    lazy = dask.array.map_blocks(
        partial(_block, field, codes), chunks=_chunks(field), dtype=kind,
        meta=np.empty((0,) * len(DIMENSIONS), kind),
    )  # fmt: skip
    coordinates: dict = {"channel": ["red", "green", "blue"]}
    slab = field.slab
    if slab is not None and field.metric:
        lens, (column, row, columns, rows) = slab.lens_positions(), field.extent.views
        across, down = lens[column : column + columns], lens[row : row + rows]
        if field.displaced:
            across = down = served_positions(field, field.views_to_serve)
        coordinates |= {"s_m": ("column", across), "t_m": ("row", down)}
    name = field.metadata.scene.get("name") or field.path.stem
    return xarray.DataArray(lazy, coordinates, DIMENSIONS, name=name)


def _chunks(field: LightFieldFile) -> tuple[tuple[int, ...], ...]:
    """The chunks' sides along each dimension: by segments, or by rows of views made by depth."""
    if field.displaced:
        count, (width, height) = field.views_to_serve, field.made_views.size
        return (1,) * count, (count,), (height,), (width,), (3,)
    by_views = field.layout.kind == "views"
    held = field.extent.views if by_views else (*field.corner, *field.picture_size)
    starts, sizes = np.split(field.metadata.segments.numbers[:, :FIRST], 2, axis=1)
    sides = []
    for axis, count in ((1, held[3]), (0, held[2])):
        low, size = starts[:, axis] - held[axis], sizes[:, axis]
        edges = np.concatenate([low, low + size, [0, count]])
        sides.append(tuple(np.diff(np.unique(edges.clip(0, count))).tolist()))
    columns, rows = field.grid
    width, height = field.picture_size
    whole = ((height,), (width,)) if by_views else ((rows,), (columns,))
    return (*sides, *whole, (3,)) if by_views else (*whole, *sides, (3,))


def _block(field: LightFieldFile, codes: bool, block_info: dict | None = None) -> np.ndarray:
    (j0, j1), (i0, i1), (v0, v1), (u0, u1), _ = (block_info or {})[None]["array-location"]
    if field.displaced:
        places = served_positions(field, field.views_to_serve)
        row = views_at(field, np.stack([places, np.full_like(places, places[j0])], 1))
        return srgb_codes(row[None]) if codes else row[None]
    return field.block((i0, j0, i1, j1), (u0, v0, u1, v1), codes=codes)
