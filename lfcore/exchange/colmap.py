"""COLMAP's text model: one PINHOLE camera per image, so that principal points are exact.

World and cameras have x right, y down, z forward, without rotation.  ``points3D.txt`` is empty.
A model can be imported if its cameras are parallel and on a grid; its unit is read as metres.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lfcore.exchange import posed
from lfcore.exchange.grid import ExchangeError, ReadOptions, ViewGrid, WriteOptions, unreadable
from lfcore.exchange.source import Source
from lfcore.files import write_text
from lfcore.pictures import write_picture

MODEL = Path("sparse") / "0"
PARAMETERS = {"PINHOLE": (0, 2, 3), "SIMPLE_PINHOLE": (0, 1, 2), "OPENCV": (0, 2, 3)}
"""The places of focal length and principal point among a camera's parameters."""


def recognise(path: Path) -> bool:
    return (path / MODEL / "images.txt").is_file()


def read(path: Path, options: ReadOptions) -> ViewGrid:
    from scipy.spatial.transform import Rotation

    cameras = _cameras(path / MODEL / "cameras.txt")
    file = path / MODEL / "images.txt"
    poses: list[np.ndarray] = []
    lenses: list[list[float]] = []
    files: list[Path] = []
    # Every second line has the points of an image, and may be empty.
    for line in _lines(file)[::2]:
        words = line.split()
        try:
            turn, move = np.array(words[1:5], float), np.array(words[5:8], float)
            lens, name = cameras[words[8]], words[9]
            to_camera = Rotation.from_quat(turn[[1, 2, 3, 0]]).as_matrix()
        except (IndexError, KeyError, ValueError):
            raise ExchangeError(f"has a line that is no image: {line[:60]!r}", file=file) from None
        pose = np.eye(4)
        # Its cameras look along +z with y down; OpenGL's along -z with y up.
        pose[:3, :3], pose[:3, 3] = to_camera.T * [1, -1, -1], -to_camera.T @ move
        poses.append(pose)
        lenses.append(lens)
        files.append(path / "images" / name)
        if not files[-1].is_file():
            raise ExchangeError("no such file; images.txt asks for it", file=files[-1])
    if not files:
        raise ExchangeError("holds no images", file=file)
    numbers = np.array(lenses)
    if not np.ptp(numbers[:, 0]) <= 1e-3 * numbers[0, 0]:
        raise ExchangeError("focal lengths differ from camera to camera", file=file)
    return posed.views(np.array(poses), numbers[:, 1:], float(numbers[0, 0]), files, file)


def _cameras(file: Path) -> dict[str, list[float]]:
    """Focal length and principal point by the camera's number."""
    found = {}
    for line in filter(None, _lines(file)):
        words = line.split()
        try:
            numbers = [float(words[4 + place]) for place in PARAMETERS[words[1]]]
            if not (numbers[0] > 0 and np.isfinite(numbers).all()):
                raise ValueError
        except (IndexError, KeyError, ValueError):
            raise ExchangeError(
                f"has a camera that cannot be read: {line[:60]!r}", file=file,
                remedy=f"Models that can be: {', '.join(PARAMETERS)}",
            ) from None  # fmt: skip
        found[words[0]] = numbers
    return found


def _lines(file: Path) -> list[str]:
    """The lines without comments; empty lines are kept, as images have two lines each."""
    try:
        lines = file.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise unreadable(file, error) from None
    return [line for line in lines if not line.startswith("#")]


def write(source: Source, folder: Path, options: WriteOptions) -> None:
    source.require_geometry("a COLMAP model")
    model = folder / MODEL
    model.mkdir(parents=True)
    (folder / "images").mkdir()
    cameras = ["# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]"]
    images = ["# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME", "# POINTS2D[]"]
    for column, row, picture in source.views(options.progress):
        name, number = f"view_{row:03d}_{column:03d}.png", row * source.columns + column + 1
        write_picture(folder / "images" / name, picture)
        cx, cy = source.centre(column, row)
        lens = f"{source.focal_px:.12g} {source.focal_px:.12g} {cx:.12g} {cy:.12g}"
        cameras.append(f"{number} PINHOLE {source.width} {source.height} {lens}")
        x, y = -source.columns_m[column], -source.rows_m[row]
        images += [f"{number} 1 0 0 0 {x:.12g} {y:.12g} 0 {number} {name}", ""]
    for name, lines in (("cameras", cameras), ("images", images), ("points3D", ["# empty"])):
        write_text(model / f"{name}.txt", "\n".join(lines) + "\n")
