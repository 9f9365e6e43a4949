"""A grid of views from anywhere: how many, how large, how to read one, and what is known of it.

Column 0 is the leftmost camera, row 0 the top one, both as the cameras see the world; pixels
likewise.  Reading is lazy: a format's reader looks at names and sizes, and views are read when
they are encoded.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.errors import StorageError
from lfcore.optics.array import SENSOR_WIDTH_M
from lfcore.optics.camera import Camera
from lfcore.optics.slab import Extent, Slab

NOMINAL_PITCH_M, NOMINAL_FIELD, NOMINAL_DELTA = 1.0, 1.0, 1.0
"""Of a slab whose lengths mean nothing: it keeps disparities alone, from minus M pixels on."""

MOST_VIEWS = 4096
"""A side: as a camera array of a scene has at most."""


class ExchangeError(StorageError):
    """A light field of others that is incomplete or contradicts itself."""


def unreadable(file: Path, error: Exception, problem: str = "cannot be read") -> ExchangeError:
    """The error of a file that other code could not read, with the beginning of its reason."""
    return ExchangeError(f"{problem}: {' '.join(str(error).split())[:120]}", file=file)


@dataclass(frozen=True)
class Geometry:
    """Where the cameras stand and what a pixel sees; None for what is not known.

    pitch_m : from one camera to the next, across and down alike, metres.
    pixel_pitch : tangent between neighbouring pixels.
    delta : inverse distance, 1/m, at which the views coincide; 0 for parallel, unshifted cameras.
    sensor_m : width of the sensor behind the longer side, where a camera was modelled; metres.
    """

    pitch_m: float | None = None
    pixel_pitch: float | None = None
    delta: float | None = None
    sensor_m: float | None = None

    @property
    def missing(self) -> list[str]:
        """The options that would say what is not known."""
        named = {"--baseline": self.pitch_m, "--field-of-view": self.pixel_pitch,
                 "--focus": self.delta}  # fmt: skip
        return [option for option, value in named.items() if value is None]

    def or_else(self, other: Geometry) -> Geometry:
        """This, with what it lacks taken from ``other``."""
        given = {key: value for key, value in vars(self).items() if value is not None}
        return replace(other, **given)

    def slab(self, columns: int, rows: int, width: int, height: int) -> Slab:
        """The slab of such a grid; lengths are nominal where something is missing."""
        views, pixels = max(columns, rows), max(width, height)
        extent = Extent.centred(columns, rows, width, height)
        square = columns == rows and width == height
        pitch, pixel, delta = self.pitch_m, self.pixel_pitch, self.delta
        if pitch is None or pixel is None or delta is None:
            pitch, pixel, delta = NOMINAL_PITCH_M, NOMINAL_FIELD / pixels, NOMINAL_DELTA
        sensor = SENSOR_WIDTH_M if self.missing or not self.sensor_m else self.sensor_m
        distance = sensor / (pixel * pixels)
        focal = distance / (1 + distance * delta)
        camera = Camera(
            focal, sensor, focal / (views * pitch), 1 / delta if delta else math.inf
        )  # fmt: skip
        return Slab(camera, views, pixels, None if square else extent)


@dataclass(frozen=True)
class KnownGeometry(Geometry):
    """A geometry of which nothing is missing."""

    pitch_m: float
    pixel_pitch: float
    delta: float
    sensor_m: float

    @classmethod
    def of_slab(cls, slab: Slab) -> KnownGeometry:
        camera = slab.camera
        return cls(slab.lens_pitch_m, slab.pixel_pitch, camera.delta, camera.sensor_width_m)


@dataclass(frozen=True)
class ViewGrid:
    """``read(column, row)`` gives (height, width, 3): uint8 or uint16 codes of sRGB, or floating
    sRGB-encoded values in [0, 1].

    depth_m : nearest and farthest depth, where the format says.
    notes : what was left out or had to be assumed, a line each.
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
        """The same with columns, or rows, counted from the other end."""

        def read(column: int, row: int) -> np.ndarray:
            return self.read(
                self.columns - 1 - column if left else column, self.rows - 1 - row if up else row
            )

        return replace(self, read=read) if left or up else self

    @classmethod
    def of_array(cls, views: np.ndarray, name: str, **more: Any) -> ViewGrid:
        """Of (rows, columns, height, width, 3) in memory."""
        rows, columns, height, width = views.shape[:4]
        return cls(columns, rows, width, height, lambda i, j: views[j, i], name, **more)


@dataclass(frozen=True)
class Order:
    """How views in a row of files, or with two numbers in their names, lie on the grid.

    ``rows`` (row after row; the first number is the row) or ``columns``; with ``left`` columns run
    from right to left, with ``up`` rows from bottom to top, with ``snake`` every other run goes
    backwards.
    """

    columns_first: bool = False
    left: bool = False
    up: bool = False
    snake: bool = False

    @classmethod
    def parse(cls, text: str) -> Order:
        """Of words joined by ``-``, such as ``rows-up`` or ``columns-snake``."""
        first, *rest = text.lower().split("-")
        if first not in ("rows", "columns") or set(rest) - {"left", "up", "snake"}:
            raise ExchangeError(
                f"unknown order {text!r}",
                key="--order",
                remedy="Use rows or columns, then -left, -up, -snake as needed: rows-up",
            )
        return cls(first == "columns", "left" in rest, "up" in rest, "snake" in rest)

    def place(self, index: int, columns: int, rows: int) -> tuple[int, int]:
        """(column, row) of the view that comes ``index``-th, before any turning."""
        run, at = divmod(index, rows if self.columns_first else columns)
        if self.snake and run % 2:
            at = (rows if self.columns_first else columns) - 1 - at
        return (run, at) if self.columns_first else (at, run)


def grid_of_values(values: np.ndarray | None, name: str, path: Path) -> ViewGrid:
    """The grid of an array (rows, columns, height, width, channels).

    Integers are sRGB codes, floating values sRGB-encoded in [0, 1].  Raises
    :class:`ExchangeError` for anything else.
    """
    if values is None:
        raise ExchangeError(f"holds no variable {name}", file=path, remedy="Name it by --variable")
    if values.ndim == 4:
        values = values[..., None]
    if values.ndim != 5 or values.shape[-1] not in (1, 3, 4) or 0 in values.shape:
        raise ExchangeError(
            f"its {name} is {values.shape}, not (rows, columns, height, width, 3)", file=path
        )
    if values.shape[-1] == 1:
        values = np.repeat(values, 3, -1)
    values = values[..., :3]
    if values.dtype.kind == "f":
        if not np.isfinite(values).all() or values.min() < 0 or values.max() > 1:
            raise ExchangeError(f"its {name} is not within 0 and 1", file=path)
        values = values.astype(np.float32, copy=False)
    elif values.dtype not in (np.uint8, np.uint16):
        raise ExchangeError(f"its {name} is of type {values.dtype}", file=path)
    return ViewGrid.of_array(values, path.stem)
