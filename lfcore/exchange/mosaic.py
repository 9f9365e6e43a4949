"""One picture of all views side by side, as plenpy and other programs save them."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

from lfcore.exchange import pictures
from lfcore.exchange.grid import ExchangeError, ReadOptions, ViewGrid, WriteOptions
from lfcore.exchange.source import Source
from lfcore.pictures import write_picture


def recognise(path: Path) -> bool:
    return False  # a mosaic looks like any picture: --format mosaic or --views


def divided(path: Path, columns: int, rows: int) -> tuple[int, int, Callable[[], np.ndarray]]:
    """Width and height of each view in a picture of them all, and a function that reads it."""
    width, height = pictures.size_of(path)
    if width % columns or height % rows:
        raise ExchangeError(
            f"is {width} x {height} pixels, which {columns} x {rows} views do not divide",
            file=path, key="--views", remedy="Give the number of views with --views COLUMNSxROWS",
        )  # fmt: skip
    return width // columns, height // rows, cache(lambda: pictures.read(path, (width, height)))


def of_tiles(path: Path, columns: int, rows: int) -> ViewGrid:
    """The tiles of a picture."""
    w, h, whole = divided(path, columns, rows)

    def read_tile(column: int, row: int) -> np.ndarray:
        return whole()[row * h : (row + 1) * h, column * w : (column + 1) * w]

    return ViewGrid(columns, rows, w, h, read_tile, path.stem)


def read(path: Path, options: ReadOptions) -> ViewGrid:
    if not options.grid:
        raise ExchangeError(
            "a mosaic does not hold its number of views", file=path,
            remedy="Give --views COLUMNSxROWS",
        )  # fmt: skip
    return of_tiles(path, *options.grid)


def write(source: Source, folder: Path, options: WriteOptions) -> None:
    views = source.array(options.progress)
    rows, columns, height, width = views.shape[:4]
    picture = views.swapaxes(1, 2).reshape(rows * height, columns * width, 3)
    write_picture(folder / f"{source.name}_{columns}x{rows}.png", np.ascontiguousarray(picture))
