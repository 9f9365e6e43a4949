"""LLFF's ``poses_bounds.npy``: exact poses, so that nothing has to be reconstructed.

A row is a 3 x 5 matrix, camera to world with the axes [down, right, backwards], the position, and
(height, width, focal length), then the nearest and farthest depth.  It has no principal point:
views of a slab that coincide at a distance are cropped until each has its axis in the middle, to
the whole pixel.  It is read back where its cameras stand parallel on a grid; its unit is taken
for metres.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lfcore.exchange import pictures, posed
from lfcore.exchange.grid import ExchangeError, ViewGrid
from lfcore.pictures import write_picture

if TYPE_CHECKING:
    from lfcore.exchange.exporting import WriteOptions
    from lfcore.exchange.importing import ReadOptions
    from lfcore.exchange.source import Source

POSES = "poses_bounds.npy"


def recognise(path: Path) -> bool:
    return (path / POSES).is_file()


def read(path: Path, options: ReadOptions) -> ViewGrid:
    file = path / POSES
    try:
        rows = np.load(file, allow_pickle=False)
    except Exception as error:  # a damaged header makes numpy raise anything
        reason = " ".join(str(error).split())[:120]
        raise ExchangeError(f"cannot be read: {reason}", file=file) from None
    if rows.ndim != 2 or rows.shape[1] != 17 or rows.dtype.kind != "f" or not len(rows):
        raise ExchangeError(f"is {rows.dtype} {rows.shape}, not rows of 17 numbers", file=file)
    if not np.isfinite(rows).all():
        raise ExchangeError("holds numbers that are not finite", file=file)
    files = pictures.pictures_of(path / "images") if (path / "images").is_dir() else []
    if len(files) != len(rows):
        raise ExchangeError(f"has {len(rows)} poses for {len(files)} pictures", file=file)
    matrix = rows[:, :15].reshape(-1, 3, 5)
    focal = matrix[:, 2, 4]
    if not (focal.min() > 0 and np.ptp(focal) <= 1e-3 * focal[0]):
        raise ExchangeError("focal lengths differ, or are not positive", file=file)
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    down, right, back, place = (matrix[:, :, k] for k in range(4))
    poses[:, :3] = np.stack([right, -down, back, place], -1)
    width, height = pictures.size_of(files[0])
    # The pictures may have been scaled since: the focal length goes with them.
    focal_px = float(focal[0] * width / matrix[0, 1, 4]) if matrix[0, 1, 4] > 0 else float(focal[0])
    centres = np.tile([width / 2, height / 2], (len(rows), 1))
    near, far = float(rows[:, 15].min()), float(rows[:, 16].max())
    found = posed.views(poses, centres, focal_px, files, file)
    return replace(found, depth_m=(near, far)) if 0 < near <= far else found


def write(source: Source, folder: Path, options: WriteOptions) -> None:
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


def _bounds(source: Source, options: WriteOptions) -> tuple[float, float]:
    if options.near_m and options.far_m:
        return options.near_m, options.far_m
    return source.depth_range("poses_bounds.npy")


def _half(source: Source) -> tuple[int, int]:
    return source.width // 2, source.height // 2


def _middle(source: Source) -> tuple[tuple[int, int], float]:
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
