"""HDF5 files of the HCI tools: ``LF`` (rows, columns, y, x, 3), depth, disparity.

They need h5py: ``pip install 'lfcore[hdf5]'``.
"""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import BinaryIO

import numpy as np

from lfcore.exchange.grid import (
    ExchangeError,
    ReadOptions,
    ViewGrid,
    WriteOptions,
    grid_of_values,
    unreadable,
)
from lfcore.exchange.source import Source

SUFFIXES = (".h5", ".hdf5")


def recognise(path: Path) -> bool:
    return path.suffix.lower() in SUFFIXES and path.is_file()


def _h5py() -> ModuleType:
    try:
        import h5py
    except ImportError:
        raise ExchangeError(
            "HDF5 needs the package h5py", key="--format", remedy="pip install 'lfcore[hdf5]'"
        ) from None
    return h5py


def data_set(path: Path, name: str) -> np.ndarray | None:
    """The data set of that name, or None."""
    h5py = _h5py()
    try:
        with h5py.File(path, "r") as file:
            return file[name][()] if name in file else None
    except (OSError, RuntimeError, TypeError) as error:
        raise unreadable(path, error, "cannot be read as HDF5") from None


def write_arrays(file: Path | BinaryIO, **arrays: np.ndarray) -> None:
    """Write data sets by their names."""
    with _h5py().File(file, "w") as stored:
        for name, array in arrays.items():
            stored[name] = array


def read(path: Path, options: ReadOptions) -> ViewGrid:
    name = options.variable or "LF"
    return grid_of_values(data_set(path, name), name, path)


def write(source: Source, folder: Path, options: WriteOptions) -> None:
    h5py = _h5py()
    shape = (source.rows, source.columns, source.height, source.width)
    with h5py.File(folder / "scene.h5", "w") as file:
        views = file.create_dataset("LF", (*shape, 3), np.uint8)
        for column, row, picture in source.views(options.progress):
            views[row, column] = picture
        if source.geometry is not None:
            for key, value in vars(source.geometry).items():
                views.attrs[key] = value
        if not source.has_depth:
            options.notes.append("no depth was written: --scene adds it")
            return
        depths = file.create_dataset("depth_lowres", shape, np.float32)
        moved = file.create_dataset("disp_lowres", shape, np.float32)
        for row in range(source.rows):
            for column in range(source.columns):
                depth, _ = source.depth(column, row)
                depths[row, column], moved[row, column] = depth, source.disparity(depth)
