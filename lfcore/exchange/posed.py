"""Cameras with poses: parallel cameras on a grid in one plane are a light field.

Views that are written for such cameras are cropped about their axes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lfcore.exchange import pictures
from lfcore.exchange.grid import ExchangeError, Geometry, ViewGrid, WriteOptions
from lfcore.exchange.source import Source

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
    """Sort cameras (K, 4, 4), camera to world with OpenGL's axes, into a grid."""
    if not (np.abs(poses) < _FARTHEST).all():
        raise ExchangeError("holds poses that are not finite", file=file)
    turn = poses[0, :3, :3] / np.maximum(np.linalg.norm(poses[0, :3, :3], axis=0), 1e-30)
    turned = np.abs(poses[:, :3, :3] - poses[0, :3, :3]).max((1, 2))
    if turned.max() > _TURNED:
        raise ExchangeError(
            f"{names[int(turned.argmax())]} looks in another direction than {names[0]}: a light "
            "field's cameras are parallel",
            file=file,
        )
    local = (poses[:, :3, 3] - poses[0, :3, 3]) @ turn
    x, y, depth = local[:, 0], -local[:, 1], local[:, 2]
    reach = max(np.ptp(x), np.ptp(y), 1e-30)
    column, columns = _lines(x, reach)
    row, rows = _lines(y, reach)
    if np.ptp(depth) > _APART * reach / max(len(columns), len(rows)):
        raise ExchangeError(
            f"{names[int(np.abs(depth - np.median(depth)).argmax())]} is before or behind the "
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
    """The line of each value, and the positions of the lines, which gaps separate."""
    order = np.argsort(values, kind="stable")
    gap = np.diff(values[order]) > reach * _APART / 2
    line = np.empty(len(values), int)
    line[order] = np.concatenate([[0], np.cumsum(gap)])
    places = np.bincount(line, values) / np.bincount(line)
    return line, places


def shear(grid: PosedGrid, centres: np.ndarray) -> tuple[float, float]:
    """Pixels by which principal points (rows, columns, 2) move per unit of position, and the
    largest deviation from that."""
    x, y = np.broadcast_arrays(grid.x[None, :], grid.y[:, None])
    place = np.stack([x - x.mean(), y - y.mean()], -1)
    moved = centres - centres.mean((0, 1))
    power = float(np.sum(place**2))
    slope = float(np.sum(place * moved) / power) if power else 0.0
    return slope, float(np.abs(moved - slope * place).max())


def views(
    poses: np.ndarray, centres: np.ndarray, focal: float, files: Sequence[Path], described: Path
) -> ViewGrid:
    """The light field of pictures with poses (K, 4, 4), as for :func:`on_a_plane`.

    ``centres`` (K, 2) are principal points from the top left corner, ``focal`` the focal length,
    pixels.
    """
    grid = on_a_plane(poses, described, [file.name for file in files])
    size = pictures.size_of(files[0])
    delta, notes = _delta(grid, centres[grid.index], size, focal)
    folder = described.resolve().parent
    return ViewGrid(
        grid.index.shape[1], grid.index.shape[0], *size,
        lambda i, j: pictures.read(files[grid.index[j, i]], size),
        folder.name or "views", geometry=Geometry(grid.pitch, 1 / focal, delta), notes=notes,
    )  # fmt: skip


def _delta(
    grid: PosedGrid, centres: np.ndarray, size: tuple[int, int], focal: float
) -> tuple[float | None, tuple[str, ...]]:
    """The inverse distance at which the views coincide, and notes on other principal points."""
    notes, middle = [], np.array(size) / 2
    slope, off = shear(grid, centres)
    beside = np.abs(centres.mean((0, 1)) - middle).max()
    if off > 0.5:
        notes.append(f"principal points are up to {off:.2g} pixels off those of a slab")
    if beside > 0.5:
        notes.append(
            f"the axis is {beside:.3g} pixels off the pictures' middle, and was moved there"
        )
    delta = slope / focal
    if delta < -1e-9 or (off > 0.5 and off > 0.1 * abs(slope) * np.ptp(grid.x)):
        return None, tuple(notes)
    return max(delta, 0.0), tuple(notes)


Views = Iterator[tuple[int, int, np.ndarray]]


def parallel_views(source: Source, options: WriteOptions) -> tuple[tuple[int, int], Views]:
    """Half width and height of all views, and column, row and picture of each.

    Notes say what was cropped.  Raises :class:`ExchangeError` where nothing is left.
    """
    half, off = _middle(source)
    if off > 1e-6:
        options.notes.append(f"principal points are up to {off:.2g} pixels off the middle")
    if 2 * half[0] != source.width or 2 * half[1] != source.height:
        options.notes.append(
            f"views were cropped to {2 * half[0]} x {2 * half[1]} about their axes"
        )
    return half, _windows(source, options, half)


def _windows(source: Source, options: WriteOptions, half: tuple[int, int]) -> Views:
    for column, row, picture in source.views(options.progress):
        cx, cy = (round(value) for value in source.centre(column, row))
        window = picture[cy - half[1] : cy + half[1], cx - half[0] : cx + half[0]]
        yield column, row, np.ascontiguousarray(window)


def _middle(source: Source) -> tuple[tuple[int, int], float]:
    """Half width and height that every view has about its axis; their rounding error in pixels."""
    corners = [source.centre(i, j) for i in (0, source.columns - 1) for j in (0, source.rows - 1)]
    size = np.array([source.width, source.height])
    rounded = np.rint(corners)
    half = np.minimum(rounded, size - rounded).min(0).astype(int)
    if half.min() < 1:
        raise ExchangeError(
            "the views have no part in common about their axes", file=source.field.path,
            remedy="Use fewer views, nearer to the middle, with --views; or another format",
        )  # fmt: skip
    places = [source.centre(i, 0)[0] for i in range(source.columns)]
    places += [source.centre(0, j)[1] for j in range(source.rows)]
    return (int(half[0]), int(half[1])), float(np.abs(places - np.rint(places)).max())
