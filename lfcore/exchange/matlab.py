"""LFToolbox's light fields: variable ``LF`` of a .mat file, (T, S, V, U, C), rows first.

A fourth channel is a weight and left out.  Files of version 7.3 are HDF5 and need h5py.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lfcore.exchange.grid import ExchangeError, ViewGrid

VARIABLE = "LF"


def recognise(path: Path) -> bool:
    return path.suffix.lower() == ".mat" and path.is_file()


def read(path: Path, options) -> ViewGrid:
    from scipy.io import loadmat

    name = options.variable or VARIABLE
    try:
        found = loadmat(path, variable_names=[name]).get(name)
    except NotImplementedError:
        from lfcore.exchange import hdf5

        # MATLAB's arrays are transposed in HDF5: (C, U, V, S, T) as stored.
        values = hdf5.data_set(path, name)
        found = np.transpose(values) if values is not None else None
    except Exception as error:  # scipy raises what the bytes happen to break
        reason = " ".join(str(error).split())[:120]
        raise ExchangeError(f"cannot be read as a MAT file: {reason}", file=path) from None
    return of_values(found, name, path)


def of_values(values: np.ndarray | None, name: str, path: Path) -> ViewGrid:
    """The grid of an array (rows, columns, height, width, channels).

    Integers are sRGB codes, floating values sRGB-encoded in [0, 1].  Raises
    :class:`ExchangeError` for anything else.
    """
    if values is None:
        raise ExchangeError(f"holds no variable {name}", file=path, remedy="Name it by --variable")
    if values.ndim == 4:
        values = values[..., None]
    if values.ndim != 5 or values.shape[-1] not in (1, 3, 4) or 0 in values.shape:
        raise ExchangeError(
            f"its {name} is {values.shape}, not (rows, columns, height, width, 3)", file=path
        )
    if values.shape[-1] == 1:
        values = np.repeat(values, 3, -1)
    values = values[..., :3]
    if values.dtype.kind == "f":
        if not np.isfinite(values).all() or values.min() < 0 or values.max() > 1:
            raise ExchangeError(f"its {name} is not within 0 and 1", file=path)
        values = values.astype(np.float32, copy=False)
    elif values.dtype not in (np.uint8, np.uint16):
        raise ExchangeError(f"its {name} is of type {values.dtype}", file=path)
    return ViewGrid.of_array(values, path.stem)


def write(source, folder: Path, options) -> None:
    from scipy.io import savemat

    savemat(
        folder / f"{source.name}.mat", {VARIABLE: source.array(options.progress)},
        do_compression=True,
    )  # fmt: skip
