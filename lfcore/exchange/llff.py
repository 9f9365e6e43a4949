"""LLFF's ``poses_bounds.npy``: exact poses, which need no reconstruction.

A row is a 3 x 5 matrix, camera to world with the axes [down, right, backwards], the position, and
(height, width, focal length), then the nearest and farthest depth.  It has no principal point:
views that coincide at a finite distance are cropped so that each has its axis in the middle, to
the whole pixel.  Poses can be imported if the cameras are parallel and on a grid; their unit is
read as metres.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from lfcore.exchange import pictures, posed
from lfcore.exchange.grid import ExchangeError, ReadOptions, ViewGrid, WriteOptions, unreadable
from lfcore.exchange.posed import parallel_views
from lfcore.exchange.source import Source
from lfcore.pictures import write_picture

POSES = "poses_bounds.npy"


def recognise(path: Path) -> bool:
    return (path / POSES).is_file()


def read(path: Path, options: ReadOptions) -> ViewGrid:
    file = path / POSES
    try:
        rows = np.load(file, allow_pickle=False)
    except Exception as error:  # a damaged header makes numpy raise anything
        raise unreadable(file, error) from None
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
    # The pictures may have been scaled since; the focal length is scaled alike.
    focal_px = float(focal[0] * width / matrix[0, 1, 4]) if matrix[0, 1, 4] > 0 else float(focal[0])
    centres = np.tile([width / 2, height / 2], (len(rows), 1))
    near, far = float(rows[:, 15].min()), float(rows[:, 16].max())
    found = posed.views(poses, centres, focal_px, files, file)
    return replace(found, depth_m=(near, far)) if 0 < near <= far else found


def write(source: Source, folder: Path, options: WriteOptions) -> None:
    source.require_geometry("poses_bounds.npy")
    near, far = _bounds(source, options)
    half, views = parallel_views(source, options)
    (folder / "images").mkdir()
    rows = []
    for column, row, picture in views:
        write_picture(folder / "images" / f"view_{row:03d}_{column:03d}.png", picture)
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
