"""nerfstudio's ``transforms.json``: poses with OpenGL's axes, and a principal point per frame.

Views that coincide at a finite distance have principal points that move with the camera;
nerfstudio reads one per frame where the file has none for all.  The world has z up.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from lfcore.exchange import pictures, posed
from lfcore.exchange.grid import ExchangeError, ReadOptions, ViewGrid, WriteOptions, unreadable
from lfcore.exchange.source import Source
from lfcore.files import write_json
from lfcore.pictures import write_picture

CONFIG = "transforms.json"
TO_WORLD = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
"""The turn from x right, y up, z back to x right, y forward, z up."""
MOST_MM = 65535


def recognise(path: Path) -> bool:
    return path.name == CONFIG or (path / CONFIG).is_file()


def read(path: Path, options: ReadOptions) -> ViewGrid:
    file = path / CONFIG if path.is_dir() else path
    data = load_json(file)
    frames = data.get("frames")
    if not isinstance(frames, list) or not frames:
        raise ExchangeError("holds no frames", file=file, key="frames")
    names = [str(frame.get("file_path", "?")) for frame in frames]
    files = [_file(file.parent, name) for name in names]
    focal = _of_all(data, frames, "fl_x", file)
    found = posed.views(
        _poses(frames, file), _centres(data, frames, files, file), focal, files, file
    )
    if any(data.get(key) for key in ("k1", "k2", "k3", "p1", "p2")):
        note = "the lens's distortion was not corrected"
        return replace(found, notes=(*found.notes, note))
    return found


def load_json(file: Path) -> dict:
    """The object in a JSON file; :class:`ExchangeError` for anything else."""
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, ValueError, RecursionError) as error:
        raise unreadable(file, error) from None
    if not isinstance(data, dict):
        raise ExchangeError("is no JSON object", file=file)
    return data


def _poses(frames: list, file: Path) -> np.ndarray:
    try:
        poses = np.array([frame["transform_matrix"] for frame in frames], np.float64)
    except (KeyError, TypeError, ValueError):
        poses = np.zeros(0)
    if poses.shape[1:] not in ((4, 4), (3, 4)):
        raise ExchangeError("is not 4 x 4 in every frame", file=file, key="transform_matrix")
    return poses


def _file(folder: Path, name: str) -> Path:
    for suffix in ("", ".png", ".jpg"):
        if (folder / (name + suffix)).is_file():
            return folder / (name + suffix)
    raise ExchangeError(f"no such file; {CONFIG} asks for it", file=folder / name)


def _of_all(data: dict, frames: list, key: str, file: Path) -> float:
    """A number that all cameras share."""
    values = {data[key]} if key in data else {frame.get(key) for frame in frames}
    try:
        found = [float(value) for value in values]
    except (TypeError, ValueError):
        raise ExchangeError("is missing or no number", file=file, key=key) from None
    if not found or max(found) - min(found) > 1e-3 * max(found) or not min(found) > 0:
        raise ExchangeError("differs from camera to camera, or is not positive", file=file, key=key)
    return found[0]


def _centres(data: dict, frames: list, files: list[Path], file: Path) -> np.ndarray:
    """(K, 2) principal points: one for all frames, one per frame, or the middle."""
    middle = dict(zip(("cx", "cy"), np.array(pictures.size_of(files[0])) / 2, strict=True))
    try:
        return np.array(
            [[float(data.get(key, frame.get(key, middle[key]))) for key in middle]
             for frame in frames]
        )  # fmt: skip
    except (TypeError, ValueError):
        raise ExchangeError("is no number", file=file, key="cx, cy") from None


def write(source: Source, folder: Path, options: WriteOptions) -> None:
    geometry = source.require_geometry("transforms.json")
    (folder / "images").mkdir()
    if source.has_depth:
        (folder / "depth").mkdir()
    frames = []
    parallel = geometry.delta == 0
    for column, row, picture in source.views(options.progress):
        name = f"view_{row:03d}_{column:03d}.png"
        write_picture(folder / "images" / name, picture)
        pose = TO_WORLD @ source.pose(column, row)
        frame = {"file_path": f"images/{name}", "transform_matrix": pose.tolist()}
        if not parallel:
            cx, cy = source.centre(column, row)
            frame |= {"cx": float(cx), "cy": float(cy)}
        if source.has_depth:
            depth, _ = source.depth(column, row)
            write_picture(folder / "depth" / name, _millimetres(depth))
            frame["depth_file_path"] = f"depth/{name}"
        frames.append(frame)
    shared = {
        "camera_model": "OPENCV", "fl_x": source.focal_px, "fl_y": source.focal_px,
        "w": source.width, "h": source.height, "k1": 0.0, "k2": 0.0, "p1": 0.0, "p2": 0.0,
        "orientation_override": "none",
    }  # fmt: skip
    if parallel:
        shared |= dict(zip(("cx", "cy"), map(float, source.axis_px), strict=True))
    write_json(folder / CONFIG, {**shared, "frames": frames})
    if not source.has_depth:
        options.notes.append("no depth was written: --scene adds it")


def _millimetres(depth: np.ndarray) -> np.ndarray:
    """uint16; 0, which is "not known", for a miss and for what is farther than 65.5 m."""
    mm = np.rint(1e3 * np.where(np.isfinite(depth), depth, np.inf).astype(np.float64))
    return np.where(mm <= MOST_MM, mm, 0).astype(np.uint16)
