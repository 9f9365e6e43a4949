"""Any folder of pictures: one view per file, by two numbers in the names or by their order.

PlenoptiCam's ``viewpoints_9px/00_00.png`` (row_column) is an example.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from lfcore.exchange import pictures
from lfcore.exchange.grid import ExchangeError, Order, ReadOptions, ViewGrid

View = TypeVar("View")
_TWO = re.compile(r"(?<!\d)(\d+)_(\d+)$")


def recognise(path: Path) -> bool:
    return path.is_dir() and len(pictures.pictures_of(path)) > 0


def read(path: Path, options: ReadOptions) -> ViewGrid:
    if not path.is_dir():
        raise ExchangeError("is no folder of views", file=path)
    files = pictures.pictures_of(path)
    if not files:
        raise ExchangeError("holds no pictures", file=path)
    order = options.order or Order()
    numbered = None if options.grid else by_numbers(files, path, order)
    return of_files(numbered or in_order(files, path, options.grid, order), path.name)


def of_files(files: list[list[Path]], name: str, **more: Any) -> ViewGrid:
    """The grid of ``files[row][column]``, all of the size of the first."""
    size = pictures.size_of(files[0][0])
    return ViewGrid(
        len(files[0]), len(files), *size, lambda i, j: pictures.read(files[j][i], size), name,
        **more,
    )  # fmt: skip


def by_numbers(files: list[Path], folder: Path, order: Order) -> list[list[Path]] | None:
    """``files[row][column]`` by the two numbers that end each name; None if one has none."""
    found = [(file, match) for file in files if (match := _TWO.search(file.stem))]
    if len(found) < len(files):
        return None
    places: dict[tuple[int, int], Path] = {}
    for file, match in found:
        first, second = int(match[1]), int(match[2])
        place = (second, first) if order.columns_first else (first, second)
        if place in places:
            raise ExchangeError(f"has the numbers of {places[place].name}, too", file=file)
        places[place] = file
    numbers = list(zip(*places, strict=True))
    lines = [range(min(each), max(each) + 1) for each in numbers]
    return full_grid(places, lines, folder)


def full_grid(
    places: Mapping[tuple[int, int], View], lines: Sequence[Sequence[int]], folder: Path
) -> list[list[View]]:
    """The views at each pair of the numbers ``lines``; :class:`ExchangeError` if one is missing."""
    for place in ((first, second) for first in lines[0] for second in lines[1]):
        if place not in places:
            raise ExchangeError(
                f"lacks the view in row {place[0]} and column {place[1]}: {len(places)} of "
                f"{len(lines[0])} x {len(lines[1])} are there",
                file=folder,
            )
    return [[places[first, second] for second in lines[1]] for first in lines[0]]


def in_order(
    files: list[Path], folder: Path, grid: tuple[int, int] | None, order: Order
) -> list[list[Path]]:
    """``files[row][column]`` by the order of the names."""
    if grid is None:
        side = math.isqrt(len(files))
        if side * side != len(files):
            raise ExchangeError(
                f"holds {len(files)} pictures, which is no square number, and their names do not "
                "number rows and columns",
                file=folder,
                remedy="Give --views COLUMNSxROWS",
            )
        grid = side, side
    columns, rows = grid
    if columns * rows != len(files):
        raise ExchangeError(
            f"holds {len(files)} pictures; {columns} x {rows} views were asked for",
            file=folder,
            key="--views",
        )
    out = [[files[0]] * columns for _ in range(rows)]
    for index, file in enumerate(files):
        column, row = order.place(index, columns, rows)
        out[row][column] = file
    return out
