"""Looking Glass quilts: views from left to right as tiles, the first at the bottom left.

The name holds columns, rows and the aspect of a view: ``name_qs8x6a0.75.png``.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from lfcore.exchange import pictures
from lfcore.exchange.grid import ExchangeError, ReadOptions, ViewGrid, WriteOptions
from lfcore.exchange.mosaic import of_tiles
from lfcore.exchange.source import Source
from lfcore.pictures import write_picture

LOOKING_GLASS = (8, 6)
"""Columns and rows of a quilt of a file that gives any views."""
_NAME = re.compile(r"_qs(\d+)x(\d+)a([\d.]+?)(?:\.[A-Za-z]+)$")


def recognise(path: Path) -> bool:
    return pictures.is_picture(path) and bool(_NAME.search(path.name))


def read(path: Path, options: ReadOptions) -> ViewGrid:
    match = _NAME.search(path.name)
    if options.grid:
        columns, rows = options.grid
    elif match:
        columns, rows = int(match[1]), int(match[2])
    else:
        raise ExchangeError(
            "its name does not hold columns and rows, as in name_qs8x6a0.75.png", file=path,
            remedy="Give --views COLUMNSxROWS",
        )  # fmt: skip
    tiles = of_tiles(path, columns, rows)

    def read_tile(column: int, row: int) -> np.ndarray:
        return tiles.read(column % columns, rows - 1 - column // columns)

    return replace(tiles, columns=columns * rows, rows=1, read=read_tile)


def write(source: Source, folder: Path, options: WriteOptions) -> None:
    across, down = options.tiles or (LOOKING_GLASS if source.free else _factors(source.columns))
    if across * down > source.columns and not source.free:
        raise ExchangeError(
            f"a quilt of {across} x {down} shows {across * down} views; there are "
            f"{source.columns} in a row",
            file=source.field.path,
            key="tiles",
        )
    crop = (source.left, source.top, source.width, source.height)
    chosen = replace(source.selection, views=(across * down, 1), crop=crop)
    if source.geometry and source.stride > 1:
        chosen = replace(chosen, baseline_m=source.pitch_m)
    row = Source(source.field, chosen, device=source.device)
    height, width = source.height, source.width
    quilt = np.empty((down * height, across * width, 3), np.uint8)
    for index, _, picture in row.views(options.progress):
        line, column = down - 1 - index // across, index % across
        quilt[line * height : (line + 1) * height, column * width : (column + 1) * width] = picture
    name = f"{source.name}_qs{across}x{down}a{width / height:.6g}.png"
    write_picture(folder / name, quilt)
    if source.rows > 1 and not source.free:
        options.notes.append("a quilt shows one row of views: the middle one was used")


def _factors(count: int) -> tuple[int, int]:
    """Columns and rows of exactly ``count`` tiles, as near to a square as possible."""
    rows = max(k for k in range(1, int(count**0.5) + 1) if count % k == 0)
    return count // rows, rows
