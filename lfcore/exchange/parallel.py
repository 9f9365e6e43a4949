"""Views cropped about their axes, as parallel cameras without lens shift record them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lfcore.exchange.grid import ExchangeError, WriteOptions
from lfcore.exchange.source import Source

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
