"""JPEG Pleno's test material: one PPM per view, ``000_000.ppm``, 10 bits per sample.

Two orders are in use: the verification model names views column_row (``--order columns``, the
default), other programs row_column (``--order rows``).
"""

from __future__ import annotations

import re
from pathlib import Path

from lfcore.exchange import folder as by_file
from lfcore.exchange import pictures
from lfcore.exchange.grid import ExchangeError, Order, ReadOptions, ViewGrid, WriteOptions
from lfcore.exchange.source import Source

_NAME = re.compile(r"\d{3}_\d{3}\.ppm")
BITS = 10


def _views(path: Path) -> list[Path]:
    if not path.is_dir():
        return []
    return sorted(file for file in path.iterdir() if _NAME.fullmatch(file.name))


def recognise(path: Path) -> bool:
    return bool(_views(path))


def read(path: Path, options: ReadOptions) -> ViewGrid:
    files = _views(path)
    if not files:
        raise ExchangeError("holds no views named 000_000.ppm", file=path)
    order = options.order or Order(columns_first=True)
    grid = by_file.by_numbers(files, path, order)
    assert grid is not None  # names that match _NAME have both numbers
    return by_file.of_files(grid, path.name)


def write(source: Source, folder: Path, options: WriteOptions) -> None:
    order = options.order or Order(columns_first=True)
    if max(source.columns, source.rows) > 1000:
        raise ExchangeError(
            "has more than 1000 views per side, which the names cannot number",
            file=source.field.path,
        )
    for column, row, picture in source.views(options.progress):
        first, second = (column, row) if order.columns_first else (row, column)
        path = folder / f"{first:03d}_{second:03d}.ppm"
        pictures.write_ppm(path, picture, BITS)
