"""LLFF's ``poses_bounds.npy``: exact poses, so that nothing has to be reconstructed.

A row is a 3 x 5 matrix, camera to world with the axes [down, right, backwards], the position, and
(height, width, focal length), then the nearest and farthest depth.  It has no principal point:
views of a slab that coincide at a distance are cropped until each has its axis in the middle, to
the whole pixel.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lfcore.exchange import pictures
from lfcore.exchange.grid import ExchangeError
from lfcore.pictures import write_picture


def write(source, folder: Path, options) -> None:
    source.require_geometry("poses_bounds.npy")
    near, far = _bounds(source, options)
    half, off = _middle(source)
    if off > 1e-6:
        options.notes.append(f"principal points lie up to {off:.2g} pixels beside the middle")
    if 2 * half != (source.width, source.height) and half != _half(source):
        options.notes.append(
            f"views were cropped to {2 * half[0]} x {2 * half[1]} about their axes"
        )
    (folder / "images").mkdir()
    rows = []
    for column, row, picture in source.views(options.progress):
        cx, cy = (round(value) for value in source.centre(column, row))
        window = picture[cy - half[1] : cy + half[1], cx - half[0] : cx + half[0]]
        pictures.write(folder / "images" / f"view_{row:03d}_{column:03d}.png",
                       np.ascontiguousarray(window))  # fmt: skip
        pose = source.pose(column, row)
        down, right, back = -pose[:3, 1], pose[:3, 0], pose[:3, 2]
        size = np.array([2 * half[1], 2 * half[0], source.focal_px])
        matrix = np.stack([down, right, back, pose[:3, 3], size], 1)
        rows.append(np.concatenate([matrix.reshape(-1), [near, far]]))
    write_picture(folder / "poses_bounds.npy", np.array(rows, np.float64))


def _bounds(source, options) -> tuple[float, float]:
    if options.near_m and options.far_m:
        return options.near_m, options.far_m
    return source.depth_range("poses_bounds.npy")


def _half(source) -> tuple[int, int]:
    return source.width // 2, source.height // 2


def _middle(source) -> tuple[tuple[int, int], float]:
    """Half width and height that every view has about its axis; how far that is off a pixel."""
    corners = [source.centre(i, j) for i in (0, source.columns - 1) for j in (0, source.rows - 1)]
    size = np.array([source.width, source.height])
    rounded = np.rint(corners)
    half = np.minimum(rounded, size - rounded).min(0).astype(int)
    if half.min() < 1:
        raise ExchangeError(
            "its views have no part in common about their axes", file=source.field.path,
            remedy="Take views nearer to the middle with --views, or another format",
        )  # fmt: skip
    places = [source.centre(i, 0)[0] for i in range(source.columns)]
    places += [source.centre(0, j)[1] for j in range(source.rows)]
    return (int(half[0]), int(half[1])), float(np.abs(places - np.rint(places)).max())
