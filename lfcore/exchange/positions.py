"""Views whose names hold the cameras' positions, as in Stanford's archive.

``name_i_j_y_x`` has two indices and two coordinates, y down and x to the right; the positions
decide, in whatever direction the indices run.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lfcore.exchange import pictures
from lfcore.exchange.grid import ExchangeError

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


def parse(path: Path) -> Named | None:
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
    return [found for file in pictures.pictures_of(folder) if (found := parse(file))]


@dataclass(frozen=True)
class Placed:
    """``files[row][column]`` with the step between cameras, in the names' unit.

    ``step`` is None where steps differ too much; ``off`` is the largest distance of a camera from
    its place on an even grid, in steps.
    """

    files: list[list[Path]]
    step: float | None
    off: float


def placed(folder: Path, named: list[Named]) -> Placed:
    """Sort views by their positions.

    Raises :class:`ExchangeError` when they are not a full grid.
    """
    by_index = {(one.first, one.second): one for one in named}
    lines = sorted({one.first for one in named}), sorted({one.second for one in named})
    if len(by_index) != len(named):
        raise ExchangeError("holds two views of one index", file=folder)
    for first in lines[0]:
        for second in lines[1]:
            if (first, second) not in by_index:
                raise ExchangeError(
                    f"lacks the view of indices {first} and {second}: {len(named)} of "
                    f"{len(lines[0])} x {len(lines[1])} are there",
                    file=folder,
                )
    grid = [[by_index[a, b] for b in lines[1]] for a in lines[0]]
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


def notes(found: Placed) -> tuple[str, ...]:
    """What a light field file cannot hold of the cameras' positions."""
    if found.step is None:
        return ("steps across and down differ, so the spacing was not imported",)
    if found.off > 0.01:
        return (
            f"cameras are up to {found.off:.2g} steps off an even grid, and were moved onto it",
        )
    return ()
