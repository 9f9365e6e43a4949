"""Scan orders of a rectangular grid: raster, serpentine and Hilbert.

Each function returns (rows * columns, 2) int32 cells (column, row), every cell once.  Frames that
follow one another should look alike, so an order is good when its steps are short.
"""

from __future__ import annotations

import numpy as np


def raster(columns: int, rows: int) -> np.ndarray:
    """Row after row, each from the left: one long step at the end of each row."""
    row, column = np.divmod(np.arange(columns * rows, dtype=np.int32), np.int32(columns))
    return np.stack([column, row], axis=1)


def serpentine(columns: int, rows: int) -> np.ndarray:
    """Every other row from the right: all steps have length one."""
    cells = raster(columns, rows)
    back = cells[:, 1] % 2 == 1
    cells[back, 0] = columns - 1 - cells[back, 0]
    return cells


def hilbert(columns: int, rows: int) -> np.ndarray:
    """Squares chained along the longer side, a Hilbert curve in each, cells outside left out.

    All steps have length one where the shorter side is a power of two that divides the longer.
    """
    if rows > columns:
        return np.ascontiguousarray(hilbert(rows, columns)[:, ::-1])
    side = 1 << (rows - 1).bit_length()
    cells = _hilbert_square(side)
    squares = -(-columns // side)
    shift = np.zeros((squares, 1, 2), np.int32)
    shift[:, 0, 0] = np.arange(squares) * side
    chain = (cells[None] + shift).reshape(-1, 2)
    return chain[(chain[:, 0] < columns) & (chain[:, 1] < rows)]


def _hilbert_square(side: int) -> np.ndarray:
    """The curve from (0, 0) to (side - 1, 0) of a square, by reflections and copies of the
    quadrants' (Hilbert 1891)."""
    curve = np.zeros((1, 2), np.int32)
    half = 1
    while half < side:
        first = curve[:, ::-1]
        last = np.stack([2 * half - 1 - curve[:, 1], half - 1 - curve[:, 0]], axis=1)
        up, across = np.array([0, half], np.int32), np.array([half, half], np.int32)
        curve = np.concatenate([first, curve + up, curve + across, last]).astype(np.int32)
        half *= 2
    return curve


ORDERS = {"raster": raster, "serpentine": serpentine, "hilbert": hilbert}
