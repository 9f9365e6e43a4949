"""Views as one array: LFToolbox's .mat files, and HDF5 files of the HCI tools.

Both have ``LF`` (rows, columns, y, x, channels); a fourth channel is a weight and is left out.
HDF5, and MATLAB's files of version 7.3, need h5py: ``pip install 'lfcore[hdf5]'``.
"""

import io
import os
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any, BinaryIO

import numpy as np

from lfcore.exchange.grid import ReadOptions, ViewGrid, WriteOptions
from lfcore.exchange.reading import ExchangeError, unreadable
from lfcore.exchange.source import Source
from lfcore.files import whole_file

VARIABLE = "LF"


def _grid(values: np.ndarray | None, name: str, path: Path) -> ViewGrid:
    """Make a grid of integers (sRGB codes) or of sRGB-encoded floats in [0, 1]."""
    if values is None:
        remedy = "Name its variable"
        raise ExchangeError(f"holds no variable {name}", file=path, key="variable", remedy=remedy)
    if values.ndim == 4:
        values = values[..., None]
    if values.ndim != 5 or values.shape[-1] not in (1, 3, 4) or 0 in values.shape:
        problem = f"its {name} is {values.shape}, not (rows, columns, height, width, 3)"
        raise ExchangeError(problem, file=path)
    values = np.repeat(values, 3, -1) if values.shape[-1] == 1 else values[..., :3]
    if values.dtype.kind == "f":
        if not (values.min() >= 0 and values.max() <= 1):  # NaN is not, either
            raise ExchangeError(f"its {name} is not within 0 and 1", file=path)
        values = values.astype(np.float32, copy=False)
    elif values.dtype not in (np.uint8, np.uint16):
        raise ExchangeError(f"its {name} is of type {values.dtype}", file=path)
    return ViewGrid.of_array(values, path.stem)


MATRIX, COMPRESSED = 14, 15
"""The types of MAT elements that contain others."""
ORDERS = {b"\x00\x01IM": "<", b"\x01\x00MI": ">"}
"""The byte orders by the end of a MAT file's header, version 5."""
LAST_TYPE = 18
"""The last type of a MAT element; source: MathWorks, "MAT-File Format", table 1-1."""


def _check_types(data: bytes, order: str) -> None:
    """Raise ValueError for an element of unknown type: scipy looks its size up without a check."""
    start = 0
    while start + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, start)
        if kind >> 16:  # the content is in the tag
            kind, size = kind & 0xFFFF, 0
        if not 1 <= kind <= LAST_TYPE:
            raise ValueError(f"an element has the unknown type {kind}")
        content = data[start + 8 : start + 8 + size]
        if kind == COMPRESSED:
            content = zlib.decompressobj().decompress(content)
        if kind in (COMPRESSED, MATRIX):
            _check_types(content, order)
        start += 8 + (size if kind == COMPRESSED else -(-size // 8) * 8)


def read_mat(path: Path, options: ReadOptions) -> ViewGrid:
    from scipy.io import loadmat

    name = options.variable or VARIABLE
    try:
        data = path.read_bytes()
        if order := ORDERS.get(data[124:128]):
            _check_types(data[128:], order)
        views = loadmat(path, variable_names=[name]).get(name)
    except NotImplementedError:
        # MATLAB's arrays are transposed in HDF5: (C, U, V, S, T) as stored.
        values = data_set(path, name)
        views = np.transpose(values) if values is not None else None
    except Exception as error:  # scipy raises what the bytes happen to break
        raise unreadable(path, error, "cannot be read as a MAT file") from None
    return _grid(views, name, path)


def write_mat(source: Source, folder: Path, options: WriteOptions) -> None:
    mat_array(folder / f"{source.name}.mat", source.array(options.progress), small=True)


def mat_array(file: Path | BinaryIO, views: np.ndarray, *, small: bool = False) -> None:
    """Write views (rows, columns, height, width, 3); ``small``: compressed, which takes longer."""
    from scipy.io import savemat

    savemat(file, {VARIABLE: views}, do_compression=small)


def _h5py() -> ModuleType:
    try:
        import h5py
    except ImportError:
        problem = "HDF5 needs the package h5py"
        raise ExchangeError(problem, key="format", remedy="pip install 'lfcore[hdf5]'") from None
    return h5py


def data_set(path: Path, name: str) -> np.ndarray | None:
    """Read the data set of this name; None if there is none."""
    h5py = _h5py()
    try:
        with h5py.File(path, "r") as file:
            return file[name][()] if name in file else None
    except (OSError, RuntimeError, TypeError) as error:
        raise unreadable(path, error, "cannot be read as HDF5") from None


class _KeptFailure(io.RawIOBase):
    """A file whose writes never fail: HDF5 crashes when it closes a file on a full disk.

    ``error`` is the first failure; later writes are dropped.
    """

    def __init__(self, file: BinaryIO):
        self._file = file
        self.error: OSError | None = None

    def write(self, data: Any) -> int:
        if self.error is None:
            try:
                return self._file.write(data)
            except OSError as error:
                self.error = error
        return memoryview(data).nbytes

    def readinto(self, into: Any) -> int:
        held = b"" if self.error else self._file.read(len(into))
        into[:] = held.ljust(len(into), b"\0")
        return len(into)

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        return 0 if self.error else self._file.seek(offset, whence)

    def tell(self) -> int:
        return 0 if self.error else self._file.tell()

    def truncate(self, size: int | None = None) -> int:
        return 0 if self.error else self._file.truncate(size)

    def flush(self) -> None:
        """The end of the block flushes."""


@contextmanager
def _written(file: BinaryIO) -> Iterator[Any]:
    """An ``h5py.File`` to write; raises OSError on a full disk."""
    guarded = _KeptFailure(file)
    with _h5py().File(guarded, "w") as stored:
        yield stored
    if guarded.error:
        raise guarded.error


def hdf5_arrays(file: BinaryIO, **arrays: np.ndarray) -> None:
    """Write data sets by their names."""
    with _written(file) as stored:
        for name, array in arrays.items():
            stored[name] = array


def read_hdf5(path: Path, options: ReadOptions) -> ViewGrid:
    name = options.variable or VARIABLE
    return _grid(data_set(path, name), name, path)


def write_hdf5(source: Source, folder: Path, options: WriteOptions) -> None:
    shape = (source.rows, source.columns, source.height, source.width)
    with whole_file(folder / "scene.h5") as whole, _written(whole) as file:
        views = file.create_dataset(VARIABLE, (*shape, 3), np.uint8)
        for column, row, picture in source.views(options.progress):
            views[row, column] = picture
        if source.geometry is not None:
            views.attrs.update(vars(source.geometry))
        if not source.has_depth:
            options.notes.append("no depth was written: give the scene to add it")
            return
        depths = file.create_dataset("depth_lowres", shape, np.float32)
        moved = file.create_dataset("disp_lowres", shape, np.float32)
        for row, column in np.ndindex(source.rows, source.columns):
            depth, _ = source.depth(column, row)
            depths[row, column], moved[row, column] = depth, source.disparity(depth)
