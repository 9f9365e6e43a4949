"""ESLF, the format of Lytro Power Tools and Stanford's multi-view sets: a picture of macropixels.

Pixel ``(v T + t, u S + s)`` is pixel (u, v) of the view in column s and row t.  Lytro's pictures
have 14 x 14 views, and black corners; an alpha channel is a weight and is left out.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lfcore.exchange import pictures
from lfcore.exchange.grid import ReadOptions, ViewGrid, WriteOptions
from lfcore.exchange.mosaic import divided
from lfcore.exchange.source import Source
from lfcore.pictures import write_picture

LYTRO = 14


def recognise(path: Path) -> bool:
    return ".eslf." in path.name.lower() and pictures.is_picture(path)


def read(path: Path, options: ReadOptions) -> ViewGrid:
    columns, rows = options.grid or (LYTRO, LYTRO)
    width, height, whole = divided(path, columns, rows)
    notes = () if options.grid else (f"taken for Lytro's {LYTRO} x {LYTRO} views; else --views",)
    name = path.name[: path.name.lower().find(".eslf.")] if ".eslf." in path.name else path.stem
    return ViewGrid(
        columns, rows, width, height, lambda i, j: whole()[j::rows, i::columns], name, notes=notes
    )  # fmt: skip


def write(source: Source, folder: Path, options: WriteOptions) -> None:
    views = source.array(options.progress)
    rows, columns, height, width = views.shape[:4]
    picture = views.transpose(2, 0, 3, 1, 4).reshape(height * rows, width * columns, 3)
    write_picture(folder / f"{source.name}.eslf.png", np.ascontiguousarray(picture))
    if (columns, rows) != (LYTRO, LYTRO):
        options.notes.append(
            f"readers take {LYTRO} x {LYTRO} views for granted: tell them {columns} x {rows}"
        )
