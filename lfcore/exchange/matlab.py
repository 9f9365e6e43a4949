"""LFToolbox's light fields: variable ``LF`` of a .mat file, (T, S, V, U, C), rows first.

A fourth channel is a weight and is left out.  Files of version 7.3 are HDF5 and need h5py.
"""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

import numpy as np

from lfcore.exchange import hdf5
from lfcore.exchange.grid import ReadOptions, ViewGrid, WriteOptions, grid_of_values, unreadable
from lfcore.exchange.source import Source

VARIABLE = "LF"


def recognise(path: Path) -> bool:
    return path.suffix.lower() == ".mat" and path.is_file()


def read(path: Path, options: ReadOptions) -> ViewGrid:
    from scipy.io import loadmat

    name = options.variable or VARIABLE
    try:
        found = loadmat(path, variable_names=[name]).get(name)
    except NotImplementedError:
        # MATLAB's arrays are transposed in HDF5: (C, U, V, S, T) as stored.
        values = hdf5.data_set(path, name)
        found = np.transpose(values) if values is not None else None
    except Exception as error:  # scipy raises what the bytes happen to break
        raise unreadable(path, error, "cannot be read as a MAT file") from None
    return grid_of_values(found, name, path)


def write(source: Source, folder: Path, options: WriteOptions) -> None:
    write_array(folder / f"{source.name}.mat", source.array(options.progress), small=True)


def write_array(file: Path | BinaryIO, views: np.ndarray, *, small: bool = False) -> None:
    """Write views (rows, columns, height, width, 3); ``small``: compressed, which takes longer."""
    from scipy.io import savemat

    savemat(file, {VARIABLE: views}, do_compression=small)
