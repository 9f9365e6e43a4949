"""Cameras with poses: those that stand parallel on a grid in one plane are a light field."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lfcore.exchange.grid import ExchangeError

_TURNED, _APART, _FARTHEST = 1e-3, 1e-2, 1e12


@dataclass(frozen=True)
class PosedGrid:
    """``index[row][column]`` into the poses; ``x`` (columns,) and ``y`` (rows,) in the cameras' own
    axes, x right and y down; ``pitch`` None where steps are not equal."""

    index: np.ndarray
    x: np.ndarray
    y: np.ndarray
    pitch: float | None


def on_a_plane(poses: np.ndarray, file: Path, names: Sequence[str]) -> PosedGrid:
    """Sort cameras (K, 4, 4), camera to world with OpenGL's axes, into a grid.

    Raises :class:`ExchangeError`, naming a camera, for ones that are turned against one another,
    do not lie in one plane or leave a place of the grid empty.
    """
    if not (np.abs(poses) < _FARTHEST).all():
        raise ExchangeError("holds poses that are not finite", file=file)
    turn = poses[0, :3, :3] / np.maximum(np.linalg.norm(poses[0, :3, :3], axis=0), 1e-30)
    turned = np.abs(poses[:, :3, :3] - poses[0, :3, :3]).max((1, 2))
    if turned.max() > _TURNED:
        raise ExchangeError(
            f"{names[int(turned.argmax())]} looks another way than {names[0]}: a light field's "
            "cameras are parallel",
            file=file,
        )
    local = (poses[:, :3, 3] - poses[0, :3, 3]) @ turn
    x, y, depth = local[:, 0], -local[:, 1], local[:, 2]
    reach = max(np.ptp(x), np.ptp(y), 1e-30)
    column, columns = _lines(x, reach)
    row, rows = _lines(y, reach)
    if np.ptp(depth) > _APART * reach / max(len(columns), len(rows)):
        raise ExchangeError(
            f"{names[int(np.abs(depth - np.median(depth)).argmax())]} stands before or behind the "
            "plane of the others",
            file=file,
        )
    index = np.full((len(rows), len(columns)), -1)
    index[row, column] = np.arange(len(poses))
    if len(poses) != index.size or (index < 0).any():
        raise ExchangeError(
            f"its {len(poses)} cameras are no full grid: {len(columns)} columns and {len(rows)} "
            "rows were found",
            file=file,
        )
    steps = np.concatenate([np.diff(columns), np.diff(rows)])
    even = len(steps) and np.ptp(steps) <= _APART * steps.mean()
    return PosedGrid(index, columns, rows, float(steps.mean()) if even else None)


def _lines(values: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Which line each value lies on, and where the lines are: gaps part them."""
    order = np.argsort(values, kind="stable")
    gap = np.diff(values[order]) > reach * _APART / 2
    line = np.empty(len(values), int)
    line[order] = np.concatenate([[0], np.cumsum(gap)])
    places = np.bincount(line, values) / np.bincount(line)
    return line, places


def shear(grid: PosedGrid, centres: np.ndarray) -> tuple[float, float]:
    """Pixels by which principal points (rows, columns, 2) move a unit of position, and how far
    they are from that at the most."""
    x, y = np.broadcast_arrays(grid.x[None, :], grid.y[:, None])
    place = np.stack([x - x.mean(), y - y.mean()], -1)
    moved = centres - centres.mean((0, 1))
    power = float(np.sum(place**2))
    slope = float(np.sum(place * moved) / power) if power else 0.0
    return slope, float(np.abs(moved - slope * place).max())
