"""Our own plain format: views as pictures, and their geometry in ``views.json``."""

from __future__ import annotations

from pathlib import Path

from lfcore.exchange import folder as by_file
from lfcore.exchange.grid import (
    MOST_VIEWS,
    ExchangeError,
    Geometry,
    ReadOptions,
    ViewGrid,
    WriteOptions,
)
from lfcore.exchange.nerfstudio import load_json
from lfcore.exchange.source import Source
from lfcore.files import write_json
from lfcore.pictures import write_picture

CONFIG = "views.json"
NAME = "view_{row:03d}_{column:03d}.png"
KIND = "lfcore views"


def recognise(path: Path) -> bool:
    return (path / CONFIG).is_file()


def read(path: Path, options: ReadOptions) -> ViewGrid:
    file = path / CONFIG
    data = load_json(file)
    try:
        if data["format"] != KIND:
            raise ValueError
        columns, rows = int(data["columns"]), int(data["rows"])
        if not (1 <= columns <= MOST_VIEWS and 1 <= rows <= MOST_VIEWS):
            raise ValueError
        known = {key: data["geometry"].get(key) for key in vars(Geometry())}
        depth = data.get("depth_m")
        geometry = Geometry(**{k: None if v is None else float(v) for k, v in known.items()})
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError):
        raise ExchangeError(f"is no description of {KIND}", file=file) from None
    files = [
        [path / NAME.format(row=row, column=column) for column in range(columns)]
        for row in range(rows)
    ]
    for line in files:
        for view in line:
            if not view.is_file():
                raise ExchangeError(f"no such file; {CONFIG} asks for {columns} x {rows} views",
                                    file=view)  # fmt: skip
    name = str(data.get("scene", path.name))
    return by_file.of_files(files, name, geometry=geometry, depth_m=tuple(depth) if depth else None)


def write(source: Source, folder: Path, options: WriteOptions) -> None:
    files = []
    for column, row, picture in source.views(options.progress):
        name = NAME.format(row=row, column=column)
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
    write_json(folder / CONFIG, data)
