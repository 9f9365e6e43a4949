"""One picture of all views: tiles, quilts, macropixels, and the raw picture of a plenoptic camera.

- A mosaic has views side by side, as plenpy and other programs save them.
- A Looking Glass quilt has them from left to right, the first at the bottom left; its name holds
  columns, rows and the aspect of a view: ``name_qs8x6a0.75.png``.
- Pixel ``(v T + t, u S + s)`` of an ESLF (Lytro Power Tools, Stanford's multi-view sets) is pixel
  (u, v) of the view in column s and row t.  Lytro's have 14 x 14 views, and black corners; an alpha
  channel is a weight and is left out.
- A raw picture has the same order, in linear light, and shows the vignetting of a round main lens.
  Programs divide it by a white image, which is beside it with the micro images' centres in
  PlenoptiCam's form: ``mic_list`` of (y, x, row, column) in pixels, ``ptc_mean`` their pitch,
  ``pat_type`` ``rec`` for a rectangular grid.
"""

import math
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from lfcore.colour import srgb_decode
from lfcore.exchange import pictures
from lfcore.exchange.grid import ReadOptions, ViewGrid, WriteOptions
from lfcore.exchange.reading import GIVE_GRID, ExchangeError
from lfcore.exchange.source import Source
from lfcore.files import write_json
from lfcore.pictures import write_picture

LYTRO = 14
"""The views per side of Lytro's pictures."""
LOOKING_GLASS = (8, 6)
"""The columns and rows of a quilt, if the file gives any number of views."""
QUILT = re.compile(r"_qs(\d+)x(\d+)a([\d.]+?)(?:\.[A-Za-z]+)$")
FINE = 16
"""The points per pixel side at which the lens's light is sampled."""
VIGNETTING = 0.9
"""The share of light that the rim of the main lens loses; the loss grows with the square of the
radius.  A calibration finds no centre in micro images of even light."""


def _divided(path: Path, columns: int, rows: int) -> tuple[int, int, Callable[[], np.ndarray]]:
    """The size of each view in a picture of all, and a function that reads this picture."""
    width, height = pictures.size_of(path)
    if width % columns or height % rows:
        problem = f"is {width} x {height} pixels, which {columns} x {rows} views do not divide"
        raise ExchangeError(problem, file=path, key="views", remedy=GIVE_GRID)
    return width // columns, height // rows, cache(lambda: pictures.read(path, (width, height)))


def _tiles(path: Path, columns: int, rows: int) -> ViewGrid:
    w, h, whole = _divided(path, columns, rows)

    def read_tile(column: int, row: int) -> np.ndarray:
        return whole()[row * h : (row + 1) * h, column * w : (column + 1) * w]

    return ViewGrid(columns, rows, w, h, read_tile, path.stem)


def read_mosaic(path: Path, options: ReadOptions) -> ViewGrid:
    if not options.views:
        problem = "a mosaic does not hold its number of views"
        raise ExchangeError(problem, file=path, remedy=GIVE_GRID)
    return _tiles(path, *options.views)


def write_mosaic(source: Source, folder: Path, options: WriteOptions) -> None:
    views = source.array(options.progress)
    rows, columns, height, width = views.shape[:4]
    picture = views.swapaxes(1, 2).reshape(rows * height, columns * width, 3)
    write_picture(folder / f"{source.name}_{columns}x{rows}.png", picture)


def recognise_eslf(path: Path) -> bool:
    return ".eslf." in path.name.lower() and pictures.is_picture(path)


def read_eslf(path: Path, options: ReadOptions) -> ViewGrid:
    columns, rows = options.views or (LYTRO, LYTRO)
    width, height, whole = _divided(path, columns, rows)
    notes = () if options.views else (f"taken for Lytro's {LYTRO} x {LYTRO} views",)
    read = lambda i, j: whole()[j::rows, i::columns]  # noqa: E731
    name = path.stem.removesuffix(".eslf")
    return ViewGrid(columns, rows, width, height, read, name, notes=notes)


def write_eslf(source: Source, folder: Path, options: WriteOptions) -> None:
    views = source.array(options.progress)
    rows, columns, height, width = views.shape[:4]
    picture = views.transpose(2, 0, 3, 1, 4).reshape(height * rows, width * columns, 3)
    write_picture(folder / f"{source.name}.eslf.png", picture)
    if (columns, rows) != (LYTRO, LYTRO):
        options.notes.append(
            f"readers take {LYTRO} x {LYTRO} views for granted: tell them {columns} x {rows}"
        )


def recognise_quilt(path: Path) -> bool:
    return pictures.is_picture(path) and bool(QUILT.search(path.name))


def read_quilt(path: Path, options: ReadOptions) -> ViewGrid:
    match = QUILT.search(path.name)
    if not (options.views or match):
        problem = "its name does not hold columns and rows, as in name_qs8x6a0.75.png"
        raise ExchangeError(problem, file=path, remedy=GIVE_GRID)
    columns, rows = options.views or (int(match[1]), int(match[2]))  # type: ignore[index]
    tiles = _tiles(path, columns, rows)

    def read_tile(column: int, row: int) -> np.ndarray:
        return tiles.read(column % columns, rows - 1 - column // columns)

    return replace(tiles, columns=columns * rows, rows=1, read=read_tile)


def write_quilt(source: Source, folder: Path, options: WriteOptions) -> None:
    # All stored views, in a grid as near to a square as possible.
    side = max(k for k in range(1, math.isqrt(source.columns) + 1) if source.columns % k == 0)
    stored = source.columns // side, side
    across, down = options.tiles or (LOOKING_GLASS if source.free else stored)
    if across * down > source.columns and not source.free:
        shown = f"a quilt of {across} x {down} shows {across * down} views"
        problem = f"{shown}; there are {source.columns} in a row"
        raise ExchangeError(problem, file=source.field.path, key="tiles")
    crop = (source.left, source.top, source.width, source.height)
    chosen = replace(source.selection, views=(across * down, 1), crop=crop)
    if source.geometry and source.stride > 1:
        chosen = replace(chosen, baseline_m=source.pitch_m)
    row = Source(source.field, chosen, device=source.device)
    tiles = row.array(options.progress)[0].reshape(down, across, row.height, row.width, 3)[::-1]
    quilt = tiles.swapaxes(1, 2).reshape(down * row.height, across * row.width, 3)
    name = f"{source.name}_qs{across}x{down}a{row.width / row.height:.6g}.png"
    write_picture(folder / name, quilt)
    if source.rows > 1 and not source.free:
        options.notes.append("a quilt shows one row of views: the middle one was used")


def _lit(samples: int) -> np.ndarray:
    """(N, N) float64: the light of each pixel of a white micro image, relative to the brightest."""
    place = (np.arange(samples * FINE) + 0.5) / FINE - samples / 2
    radius2 = (place[:, None] ** 2 + place[None, :] ** 2) / (samples / 2) ** 2
    light = np.where(radius2 <= 1, 1 - VIGNETTING * radius2, 0.0)
    share = light.reshape(samples, FINE, samples, FINE).mean((1, 3))
    return share / share.max()


def write_plenoptic(source: Source, folder: Path, options: WriteOptions) -> None:
    count, width, height = source.columns, source.width, source.height
    if count != source.rows:
        problem = f"{count} x {source.rows} views do not make square micro images"
        raise ExchangeError(problem, file=source.field.path, key="views")
    share = _lit(count)
    raw = np.empty((height * count, width * count, 3), np.uint16)
    for column, row, picture in source.views(options.progress):
        raw[row::count, column::count] = _codes(srgb_decode(picture) * share[row, column])
    write_picture(folder / f"{source.name}_raw.png", raw)
    write_picture(folder / f"{source.name}_white.png", _codes(np.tile(share, (height, width))))
    middle = (count - 1) / 2
    centres = [
        [row * count + middle, column * count + middle, row, column]
        for row in range(height)
        for column in range(width)
    ]
    data = {"pat_type": "rec", "ptc_mean": [float(count)] * 2, "mic_list": centres}
    write_json(folder / f"{source.name}_white.json", data)


def _codes(light: np.ndarray) -> np.ndarray:
    return np.rint(65535 * light.astype(np.float64)).astype(np.uint16)
