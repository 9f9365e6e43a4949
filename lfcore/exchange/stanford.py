"""The Stanford light field archive: ``out_YY_XX_y_x.png``, positions in the names.

The names hold neither the plane that the pictures are rectified to nor the field of view: --focus
and --field-of-view give them, or they stay unknown.  Positions are read as millimetres.
"""

from __future__ import annotations

from pathlib import Path

from lfcore.exchange import folder as by_file
from lfcore.exchange import positions
from lfcore.exchange.grid import ExchangeError, Geometry, ReadOptions, ViewGrid, WriteOptions
from lfcore.exchange.source import Source
from lfcore.pictures import write_picture


def recognise(path: Path) -> bool:
    found = positions.named_pictures(path)
    return bool(found) and found[0].path.name.startswith("out_")


def read(path: Path, options: ReadOptions) -> ViewGrid:
    named = positions.named_pictures(path)
    if not named:
        raise ExchangeError(
            "holds no views named with two indices, y and x", file=path,
            remedy="Names are like out_00_00_-12.5_8.0.png",
        )  # fmt: skip
    found = positions.placed(path, named)
    geometry = Geometry(pitch_m=found.step / 1e3 if found.step else None)
    return by_file.of_files(found.files, path.name, geometry=geometry, notes=positions.notes(found))


def write(source: Source, folder: Path, options: WriteOptions) -> None:
    x, y = 1e3 * source.columns_m, 1e3 * source.rows_m
    if source.geometry is None:
        options.notes.append("positions are steps of the grid: the file does not hold its geometry")
        x, y = source.columns_m, source.rows_m  # nominal metres are steps
    digits = max(2, len(str(max(source.columns, source.rows) - 1)))
    for column, row, picture in source.views(options.progress):
        name = f"out_{row:0{digits}d}_{column:0{digits}d}_{y[row]:.6f}_{x[column]:.6f}"
        write_picture(folder / f"{name}.png", picture)
