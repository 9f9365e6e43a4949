"""A grid of views of any origin: their number, size and geometry, and a function that reads one.

Column 0 is the leftmost camera, row 0 the top one, as the cameras see the world; pixels are counted
in the same directions.  Reading is lazy: a format's reader looks at names and sizes, and a view is
read when it is encoded.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lfcore.exchange.reading import ExchangeError
from lfcore.optics.grid_geometry import Geometry
from lfcore.progress import Progress

MOST_VIEWS = 4096
"""The largest number of views per side, as for a scene's camera array."""


@dataclass(frozen=True)
class ViewGrid:
    """A grid of views and its known facts.

    Attributes
    ----------
    columns, rows, width, height : int
        The number of views, and their size in pixels.
    read : callable
        ``read(column, row)`` returns (height, width, 3): uint8 or uint16 sRGB codes, or
        sRGB-encoded floats in [0, 1].
    name, format : str
        The scene's name, and the format's.
    geometry : Geometry
        The known values of the cameras.
    depth_m : (float, float), optional
        The nearest and farthest depth, metres.
    notes : tuple of str
        Facts that were left out or assumed, a line each.
    """

    columns: int
    rows: int
    width: int
    height: int
    read: Callable[[int, int], np.ndarray]
    name: str
    format: str = ""
    geometry: Geometry = field(default_factory=Geometry)
    depth_m: tuple[float, float] | None = None
    notes: tuple[str, ...] = ()

    def turned(self, left: bool = False, up: bool = False) -> ViewGrid:
        """The grid with columns, or rows, counted from the other end."""

        def read(column: int, row: int) -> np.ndarray:
            return self.read(
                self.columns - 1 - column if left else column, self.rows - 1 - row if up else row
            )

        return replace(self, read=read) if left or up else self

    @classmethod
    def of_array(cls, views: np.ndarray, name: str, **more: Any) -> ViewGrid:
        """The grid of an array (rows, columns, height, width, 3)."""
        rows, columns, height, width = views.shape[:4]
        return cls(columns, rows, width, height, lambda i, j: views[j, i], name, **more)


@dataclass(frozen=True)
class Order:
    """The order of views in a list of files, or of the two numbers in their names.

    Parameters
    ----------
    columns_first : bool
        Column after column, or the column's number first.  Default: row after row.
    left : bool
        Columns run from right to left.
    up : bool
        Rows run from bottom to top.
    snake : bool
        Every second run is backwards.
    """

    columns_first: bool = False
    left: bool = False
    up: bool = False
    snake: bool = False

    @classmethod
    def parse(cls, text: str) -> Order:
        """Read words joined by ``-``, such as ``rows-up`` or ``columns-snake``."""
        first, *rest = text.lower().split("-")
        if first not in ("rows", "columns") or set(rest) - {"left", "up", "snake"}:
            problem = f"unknown order {text!r}"
            remedy = "Use rows or columns, then -left, -up, -snake as needed: rows-up"
            raise ExchangeError(problem, key="order", remedy=remedy)
        return cls(first == "columns", "left" in rest, "up" in rest, "snake" in rest)

    def place(self, index: int, columns: int, rows: int) -> tuple[int, int]:
        """(column, row) of the view with this index, before ``left`` and ``up`` are applied."""
        run, at = divmod(index, rows if self.columns_first else columns)
        if self.snake and run % 2:
            at = (rows if self.columns_first else columns) - 1 - at
        return (run, at) if self.columns_first else (at, run)


@dataclass(frozen=True)
class ReadOptions:
    """Facts that a format may lack.

    Parameters
    ----------
    views : (int, int), optional
        Columns and rows of views.
    order : Order, optional
        The order of views.  Default: the format's own.
    geometry : Geometry
        Values that replace the format's.
    fov_deg : float, optional
        Field of view of a picture's width, degrees.
    variable : str, optional
        The variable of a MAT or HDF5 file.  Default: LF.
    """

    views: tuple[int, int] | None = None
    order: Order | None = None
    geometry: Geometry = field(default_factory=Geometry)
    fov_deg: float | None = None
    variable: str | None = None


@dataclass(frozen=True)
class WriteOptions:
    """Settings of single formats.

    Parameters
    ----------
    order : Order, optional
        The order of the two numbers in the names (JPEG Pleno).
    tiles : (int, int), optional
        Columns and rows of a quilt.
    progress : callable, optional
        Called with (views done, total).
    """

    order: Order | None = None
    tiles: tuple[int, int] | None = None
    progress: Progress | None = None
    notes: list[str] = field(default_factory=list, init=False)
