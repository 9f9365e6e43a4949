"""Triangles of strips and fans."""

import numpy as np


def strip_faces(indices: np.ndarray) -> np.ndarray:
    """(T, 3) of a strip (V,): every three in a row, every other one turned; -1 starts anew."""
    indices = np.asarray(indices, np.int64).ravel()
    if len(indices) < 3:
        return np.zeros((0, 3), np.int64)
    at = np.arange(len(indices))
    started = np.maximum.accumulate(np.where(indices < 0, at, -1)) + 1
    faces = np.stack([indices[:-2], indices[1:-1], indices[2:]], axis=1)
    turned = (at - started)[:-2] % 2 == 1
    faces[turned] = faces[turned][:, [1, 0, 2]]
    a, b, c = faces.T
    return faces[(faces >= 0).all(1) & (a != b) & (b != c) & (c != a)]


def fan_faces(indices: np.ndarray) -> np.ndarray:
    """(T, 3) of a fan (V,): every two in a row, and the first."""
    after = np.stack([indices[1:-1], indices[2:]], axis=1)
    return np.concatenate([after, np.full((len(after), 1), indices[0])], axis=1)
