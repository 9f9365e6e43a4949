"""An MP4 film through the focus, evenly in dioptres from near to far and back."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lfcore.exchange.exporting import WriteOptions
from lfcore.exchange.grid import ExchangeError
from lfcore.exchange.source import Source
from lfcore.film import write_film
from lfcore.lightfield import MOST_PLANES

FPS = 24


def write(source: Source, folder: Path, options: WriteOptions) -> None:
    field = source.field
    if not 2 <= options.count <= MOST_PLANES:
        raise ExchangeError(f"must be from 2 to {MOST_PLANES}, not {options.count}", key="--count")
    if (source.columns, source.rows) != field.grid:
        raise ExchangeError("a film takes all views", file=field.path, key="--views")
    near, far = options.near_m, options.far_m
    if not (near and far):
        near, far = source.depth_range("a film through the focus")
    source.require_geometry("a film through the focus")
    focus = [1 / d for d in np.linspace(1 / near, 1 / far, options.count)]
    made = field.refocus_many([field.plane(distance) for distance in focus])
    left, top = source.left, source.top
    made = made[:, top : top + source.height, left : left + source.width]
    write_film(folder / f"{source.name}_focus.mp4", np.concatenate([made, made[-2:0:-1]]), FPS)
