"""The Stanford light field archive: ``out_YY_XX_y_x.png``, positions in the names.

Names have two indices and two coordinates, y down and x to the right; the positions decide, in
whatever direction the indices run, and are read as millimetres.  The names hold neither the plane
that the pictures are rectified to nor the field of view: --focus and --field-of-view give them, or
they stay unknown.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lfcore.exchange import folder as by_file
from lfcore.exchange import pictures
from lfcore.exchange.grid import ExchangeError, Geometry, ReadOptions, ViewGrid, WriteOptions
from lfcore.exchange.source import Source
from lfcore.pictures import write_picture

MOST_UNEQUAL = 0.05
"""The relative difference below which steps across and down count as one pitch."""


@dataclass(frozen=True)
class Named:
    """A picture with the numbers in its name: two indices, and (x, y)."""

    path: Path
    first: int
    second: int
    x: float
    y: float


def _parse(path: Path) -> Named | None:
    """The numbers in a name, or None for another kind of name; empty words do not count."""
    words = [word for word in path.stem.split("_") if word]
    if len(words) != 5:
        return None
    try:
        first, second = int(words[1]), int(words[2])
        y, x = (float(word) for word in words[3:])
    except ValueError:
        return None
    return Named(path, first, second, x, y)


def named_pictures(folder: Path) -> list[Named]:
    if not folder.is_dir():
        return []
    return [found for file in pictures.pictures_of(folder) if (found := _parse(file))]


@dataclass(frozen=True)
class Placed:
    """``files[row][column]``, and the step between cameras, None where steps differ too much;
    ``off`` is the largest distance of a camera from an even grid, in steps."""

    files: list[list[Path]]
    step: float | None
    off: float


def placed(folder: Path, named: list[Named]) -> Placed:
    """Sort views by their positions."""
    by_index = {(one.first, one.second): one for one in named}
    lines = sorted({one.first for one in named}), sorted({one.second for one in named})
    if len(by_index) != len(named):
        raise ExchangeError("holds two views of one index", file=folder)
    grid = by_file.full_grid(by_index, lines, folder)
    x, y = (np.array([[getattr(one, key) for one in line] for line in grid]) for key in "xy")
    # The index along which y changes most counts rows.
    if np.ptp(x.mean(1)) > np.ptp(x.mean(0)) or np.ptp(y.mean(0)) > np.ptp(y.mean(1)):
        grid, x, y = [list(line) for line in zip(*grid, strict=True)], x.T, y.T
    columns, rows = np.argsort(x.mean(0), kind="stable"), np.argsort(y.mean(1), kind="stable")
    files = [[grid[j][i].path for i in columns] for j in rows]
    x, y = x[np.ix_(rows, columns)], y[np.ix_(rows, columns)]
    return Placed(files, *_step(x, y))


def _step(x: np.ndarray, y: np.ndarray) -> tuple[float | None, float]:
    steps = []
    if x.shape[1] > 1:
        steps.append(np.ptp(x.mean(0)) / (x.shape[1] - 1))
    if y.shape[0] > 1:
        steps.append(np.ptp(y.mean(1)) / (y.shape[0] - 1))
    step = float(np.mean(steps)) if steps else 0.0
    if not step > 0 or max(steps) - min(steps) > MOST_UNEQUAL * step:
        return None, 0.0
    off = [
        np.abs(values - values.mean() - (place - place.mean()) * step).max() / step
        for values, place in (
            (x, np.arange(x.shape[1])[None, :] + 0 * y), (y, np.arange(y.shape[0])[:, None] + 0 * x)
        )
    ]  # fmt: skip
    return step, float(max(off))


def _notes(found: Placed) -> tuple[str, ...]:
    """What a light field file cannot hold of the cameras' positions."""
    if found.step is None:
        return ("steps across and down differ, so the spacing was not imported",)
    if found.off > 0.01:
        return (
            f"cameras are up to {found.off:.2g} steps off an even grid, and were moved onto it",
        )
    return ()


def recognise(path: Path) -> bool:
    found = named_pictures(path)
    return bool(found) and found[0].path.name.startswith("out_")


def read(path: Path, options: ReadOptions) -> ViewGrid:
    named = named_pictures(path)
    if not named:
        raise ExchangeError(
            "holds no views named with two indices, y and x", file=path,
            remedy="Names are like out_00_00_-12.5_8.0.png",
        )  # fmt: skip
    found = placed(path, named)
    geometry = Geometry(pitch_m=found.step / 1e3 if found.step else None)
    return by_file.of_files(found.files, path.name, geometry=geometry, notes=_notes(found))


def write(source: Source, folder: Path, options: WriteOptions) -> None:
    x, y = 1e3 * source.columns_m, 1e3 * source.rows_m
    if source.geometry is None:
        options.notes.append("positions are steps of the grid: the file does not hold its geometry")
        x, y = source.columns_m, source.rows_m  # nominal metres are steps
    digits = max(2, len(str(max(source.columns, source.rows) - 1)))
    for column, row, picture in source.views(options.progress):
        name = f"out_{row:0{digits}d}_{column:0{digits}d}_{y[row]:.6f}_{x[column]:.6f}"
        write_picture(folder / f"{name}.png", picture)
