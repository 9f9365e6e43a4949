"""Folders of pictures, one view per file, placed by the numbers in their names or by their order.

- Any folder: PlenoptiCam's ``viewpoints_9px/00_00.png`` (row_column) is an example.
- Our own plain format has the geometry in ``views.json``.
- JPEG Pleno's test material has one PPM of 10 bits per view, ``000_000.ppm``.  Two orders are in
  use: the verification model names views column_row (order ``columns``, the default), other
  programs row_column (``rows``).
- The Stanford light field archive has ``out_YY_XX_y_x.png``: two indices and two coordinates, y
  down and x to the right, read as millimetres.  The positions decide, whatever the direction of the
  indices.  The names lack the rectification plane and the field of view.
"""

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from lfcore.exchange import pictures
from lfcore.exchange.grid import MOST_VIEWS, Geometry, Order, ReadOptions, ViewGrid, WriteOptions
from lfcore.exchange.reading import GIVE_GRID, ExchangeError, existing, load_json, refused
from lfcore.exchange.source import Source
from lfcore.files import write_json as save_json
from lfcore.pictures import write_picture

View = TypeVar("View")
TWO = re.compile(r"(?<!\d)(\d+)_(\d+)$")
DATE = re.compile(r"(?<!\d)(19|20)\d\d[-_.]?(0[1-9]|1[0-2])[-_.]?(0[1-9]|[12]\d|3[01])(?!\d)")
COLUMN, ROW = ("x", "c", "col", "column"), ("y", "r", "row")
"""The words before a number that say what it counts."""
PLENO = re.compile(r"\d{3}_\d{3}\.ppm")
PLENO_BITS = 10
"""Bits per sample of JPEG Pleno's pictures."""
CONFIG, KIND = "views.json", "lfcore views"
MOST_UNEQUAL = 0.05
"""The relative difference below which steps across and down count as one pitch."""


def recognise_folder(path: Path) -> bool:
    return path.is_dir() and len(pictures.pictures_of(path)) > 0


def read_folder(path: Path, options: ReadOptions) -> ViewGrid:
    files = pictures.pictures_of(path) if path.is_dir() else []
    if not files:
        raise ExchangeError("holds no pictures", file=path)
    pairs = None if options.views else _pairs([file.stem for file in files])
    if pairs is None:
        return of_files(_in_order(files, path, options.views, options.order or Order()), path.name)
    numbers, columns_first = pairs
    order = options.order or Order(columns_first)
    return of_files(_by_pairs(files, numbers, path, order), path.name)


def _pairs(stems: list[str]) -> tuple[list[tuple[int, int]], bool] | None:
    """Find the two numbers in each name that count rows and columns; and whether columns are first.

    Dates are ignored.  If names differ in their numbers only, the two numbers that vary are chosen;
    a picture's running number is not a row or column.  If one number varies, the views are a single
    row, whose constant number must have as many digits.  Other names must end with two numbers.
    """
    words = [re.split(r"(\d+)", DATE.sub("", stem.lower())) for stem in stems]
    if len({tuple(word[::2]) for word in words}) > 1:
        ends = [TWO.search(stem) for stem in stems]
        return None if None in ends else ([(int(m[1]), int(m[2])) for m in ends if m], False)
    written = list(zip(*(word[1::2] for word in words), strict=True))
    counts = [len(set(map(int, number))) for number in written]
    several, last = [k for k, count in enumerate(counts) if count > 1], len(written) - 1
    if len(several) == 2 and max(counts) == len(stems):
        return None  # one of them is the running number of the picture
    if len(several) == 1 and several[0] >= last - 1 and TWO.search(stems[0]) and last:
        other = written[2 * last - 1 - several[0]][0]
        alike = len(other) == min(map(len, written[several[0]]))
        if alike or math.isqrt(len(stems)) ** 2 != len(stems):
            several = [last - 1, last]
    elif len(several) > 2 and TWO.search(stems[0]):
        several = [last - 1, last]
    if len(several) != 2:
        return None
    labels = [re.sub(r"[^a-z]", "", words[0][2 * k]) for k in several]
    first, second = (map(int, written[k]) for k in several)
    return list(zip(first, second, strict=True)), labels[0] in COLUMN and labels[1] in ROW


def of_files(files: list[list[Path]], name: str, **more: Any) -> ViewGrid:
    """The grid of ``files[row][column]``, which must all have the size of the first."""
    size = pictures.size_of(files[0][0])
    read = lambda i, j: pictures.read(files[j][i], size)  # noqa: E731
    return ViewGrid(len(files[0]), len(files), *size, read, name, **more)


def by_numbers(files: list[Path], folder: Path, order: Order) -> list[list[Path]] | None:
    """``files[row][column]`` by the two numbers that end each name; None if one has none."""
    matches = [TWO.search(file.stem) for file in files]
    if None in matches:
        return None
    return _by_pairs(files, [(int(m[1]), int(m[2])) for m in matches if m], folder, order)


def _by_pairs(
    files: list[Path], pairs: list[tuple[int, int]], folder: Path, order: Order
) -> list[list[Path]]:
    places: dict[tuple[int, int], Path] = {}
    for file, (first, second) in zip(files, pairs, strict=True):
        place = (second, first) if order.columns_first else (first, second)
        if place in places:
            raise ExchangeError(f"has the same numbers as {places[place].name}", file=file)
        places[place] = file
    numbers = list(zip(*places, strict=True))
    return _full_grid(places, [range(min(each), max(each) + 1) for each in numbers], folder)


def _full_grid(
    places: Mapping[tuple[int, int], View], lines: Sequence[Sequence[int]], folder: Path
) -> list[list[View]]:
    """The views at all pairs of the numbers ``lines``."""
    for place in ((first, second) for first in lines[0] for second in lines[1]):
        if place not in places:
            there = f"{len(places)} of {len(lines[0])} x {len(lines[1])} are there"
            problem = f"lacks the view in row {place[0]} and column {place[1]}: {there}"
            raise ExchangeError(problem, file=folder)
    return [[places[first, second] for second in lines[1]] for first in lines[0]]


def _in_order(
    files: list[Path], folder: Path, grid: tuple[int, int] | None, order: Order
) -> list[list[Path]]:
    """``files[row][column]`` by the order of the names."""
    columns, rows = grid or (math.isqrt(len(files)),) * 2
    if columns * rows != len(files):
        reason = ", not {} x {}".format(*grid) if grid else (
            ", which is no square number, and their names do not number rows and columns"
        )  # fmt: skip
        problem = f"holds {len(files)} pictures{reason}"
        key = "views" if grid else None
        raise ExchangeError(problem, file=folder, key=key, remedy=GIVE_GRID)
    out = [[files[0]] * columns for _ in range(rows)]
    for index, file in enumerate(files):
        column, row = order.place(index, columns, rows)
        out[row][column] = file
    return out


def read_json(path: Path, options: ReadOptions) -> ViewGrid:
    file = path / CONFIG
    data = load_json(file)
    with refused(f"is no description of {KIND}", file):
        columns, rows = int(data["columns"]), int(data["rows"])
        if data["format"] != KIND or min(columns, rows) < 1 or max(columns, rows) > MOST_VIEWS:
            raise ValueError
        numbers = {key: data["geometry"].get(key) for key in vars(Geometry())}
        geometry = Geometry(**{k: None if v is None else float(v) for k, v in numbers.items()})
        depth = tuple(data["depth_m"]) if data.get("depth_m") else None
    reason = f"{CONFIG} asks for {columns} x {rows} views"
    files = [
        [existing([path / pictures.view_name(i, j)], reason) for i in range(columns)]
        for j in range(rows)
    ]
    return of_files(files, str(data.get("scene", path.name)), geometry=geometry, depth_m=depth)


def write_json(source: Source, folder: Path, options: WriteOptions) -> None:
    files = []
    for column, row, picture in source.views(options.progress):
        name = pictures.view_name(column, row)
        write_picture(folder / name, picture)
        entry = {"file": name, "column": column, "row": row}
        if source.geometry is not None:
            entry |= {"x_m": float(source.columns_m[column]), "y_m": float(source.rows_m[row])}
            entry["centre_px"] = [float(value) for value in source.centre(column, row)]
        if source.has_depth:
            depth, _ = source.depth(column, row)
            write_picture((folder / name).with_suffix(".depth.pfm"), depth)
        files.append(entry)
    reach = source.field.depth_range if source.geometry is not None else None
    data = {
        "format": KIND, "scene": source.name, "columns": source.columns, "rows": source.rows,
        "width": source.width, "height": source.height,
        "axes": "column 0 left, row 0 top; x right, y down, metres",
        "geometry": vars(source.geometry or Geometry()), "depth_m": reach and list(reach),
        "views": files,
    }  # fmt: skip
    save_json(folder / CONFIG, data)


def _pleno_views(path: Path) -> list[Path]:
    files = path.iterdir() if path.is_dir() else ()
    return sorted(file for file in files if PLENO.fullmatch(file.name))


def recognise_jpeg_pleno(path: Path) -> bool:
    return bool(_pleno_views(path))


def read_jpeg_pleno(path: Path, options: ReadOptions) -> ViewGrid:
    files = _pleno_views(path)
    if not files:
        raise ExchangeError("holds no views named 000_000.ppm", file=path)
    grid = by_numbers(files, path, options.order or Order(columns_first=True))
    assert grid is not None  # all names have both numbers
    return of_files(grid, path.name)


def write_jpeg_pleno(source: Source, folder: Path, options: WriteOptions) -> None:
    order = options.order or Order(columns_first=True)
    if max(source.columns, source.rows) > 1000:
        problem = "has more than 1000 views per side, which the names cannot number"
        raise ExchangeError(problem, file=source.field.path)
    for column, row, picture in source.views(options.progress):
        first, second = (column, row) if order.columns_first else (row, column)
        pictures.write_ppm(folder / f"{first:03d}_{second:03d}.ppm", picture, PLENO_BITS)


class _StanfordView(NamedTuple):
    """The parts of a file's name: two indices and the camera's position."""

    numbers: tuple[int, int]
    y: float
    x: float
    file: Path


def _stanford_views(folder: Path) -> list[_StanfordView]:
    views = []
    for path in pictures.pictures_of(folder) if folder.is_dir() else ():
        words = [word for word in path.stem.split("_") if word]
        try:
            _, first, second, y, x = words
            views.append(_StanfordView((int(first), int(second)), float(y), float(x), path))
        except ValueError:
            continue
    return views


def recognise_stanford(path: Path) -> bool:
    views = _stanford_views(path)
    return bool(views) and views[0].file.name.startswith("out_")


def read_stanford(path: Path, options: ReadOptions) -> ViewGrid:
    named = _stanford_views(path)
    if not named:
        problem = "holds no views named with two indices, y and x"
        raise ExchangeError(problem, file=path, remedy="Names are like out_00_00_-12.5_8.0.png")
    by_index = {view.numbers: view[1:] for view in named}
    if len(by_index) != len(named):
        raise ExchangeError("holds two views of one index", file=path)
    lines = [sorted(set(numbers)) for numbers in zip(*by_index, strict=True)]
    *places, grid = np.moveaxis(np.array(_full_grid(by_index, lines, path), object), -1, 0)
    y, x = (place.astype(float) for place in places)
    # The index along which y changes most counts rows.
    if np.ptp(x.mean(1)) > np.ptp(x.mean(0)) or np.ptp(y.mean(0)) > np.ptp(y.mean(1)):
        grid, x, y = grid.T, x.T, y.T
    order = np.ix_(np.argsort(y.mean(1), kind="stable"), np.argsort(x.mean(0), kind="stable"))
    step, notes = _step(x[order], y[order])
    geometry = Geometry(pitch_m=step and step / 1e3)
    return of_files(grid[order].tolist(), path.name, geometry=geometry, notes=notes)


def _step(x: np.ndarray, y: np.ndarray) -> tuple[float | None, tuple[str, ...]]:
    """The step between cameras at (rows, columns) positions, None where steps differ too much, and
    what a light field file cannot hold of the positions."""
    middles = x.mean(0), y.mean(1)
    steps = [np.ptp(line) / (len(line) - 1) for line in middles if len(line) > 1]
    step = float(np.mean(steps)) if steps else 0.0
    if not step > 0 or max(steps) - min(steps) > MOST_UNEQUAL * step:
        return None, ("steps across and down differ, so the spacing was not imported",)
    row, column = np.indices(x.shape)
    apart = [values - step * place for values, place in ((x, column), (y, row))]
    off = float(max(np.abs(each - each.mean()).max() for each in apart)) / step
    if off <= 0.01:
        return step, ()
    return step, (f"cameras are up to {off:.2g} steps off an even grid, and were moved onto it",)


def write_stanford(source: Source, folder: Path, options: WriteOptions) -> None:
    x, y = 1e3 * source.columns_m, 1e3 * source.rows_m
    if source.geometry is None:
        options.notes.append("positions are steps of the grid: the file does not hold its geometry")
        x, y = source.columns_m, source.rows_m  # nominal metres are steps
    digits = max(2, len(str(max(source.columns, source.rows) - 1)))
    for column, row, picture in source.views(options.progress):
        name = f"out_{row:0{digits}d}_{column:0{digits}d}_{y[row]:.6f}_{x[column]:.6f}"
        write_picture(folder / f"{name}.png", picture)
