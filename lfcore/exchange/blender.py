"""Blender's add-ons: IDLab's ``lightfield.json`` and gfxdisp's ``param.txt``.

IDLab's planes hold poses, focal length and sensor.  gfxdisp names pictures ``row_column``, counted
from the bottom right camera; ``base_x`` is half the width of the grid, in the scene's unit.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.exchange import folder, pictures, posed
from lfcore.exchange.grid import ExchangeError, Geometry, Order, ReadOptions, ViewGrid, WriteOptions
from lfcore.exchange.nerfstudio import TO_WORLD, load_json
from lfcore.exchange.posed import parallel_views
from lfcore.exchange.source import Source
from lfcore.files import write_json
from lfcore.pictures import write_picture

JSON, TEXT = "lightfield.json", "param.txt"


def recognise(path: Path) -> bool:
    return path.name == JSON or (path / JSON).is_file() or (path / TEXT).is_file()


def read(path: Path, options: ReadOptions) -> ViewGrid:
    if path.name == JSON or (path / JSON).is_file():
        return _read_json(path if path.name == JSON else path / JSON)
    if (path / TEXT).is_file():
        return _read_text(path)
    raise ExchangeError(f"holds neither {JSON} nor {TEXT}", file=path)


def _read_json(file: Path) -> ViewGrid:
    data = load_json(file)
    kind = data.get("lf_type", "PLANE")
    if kind != "PLANE":
        raise ExchangeError(
            f"is a light field on a {str(kind).lower()}; only planes can be read", file=file,
            key="lf_type",
        )  # fmt: skip
    frames: Any = data.get("frames")
    try:
        names = [str(frame["name"]) for frame in frames]
        poses = np.array([_pose(frame) for frame in frames], np.float64)
        if not names or poses.shape[1:] != (4, 4):
            raise ValueError
    except (KeyError, TypeError, ValueError):
        raise ExchangeError(
            "lacks names, positions or rotations", file=file, key="frames"
        ) from None
    grid = posed.on_a_plane(poses, file, names)
    files = [_picture(file.parent, name) for name in names]
    size = pictures.size_of(files[0])
    geometry = Geometry(grid.pitch, *_lens(data, size, file))
    return ViewGrid(
        grid.index.shape[1], grid.index.shape[0], *size,
        lambda i, j: pictures.read(files[grid.index[j, i]], size),
        file.parent.resolve().name, geometry=geometry,
    )  # fmt: skip


def _pose(frame: dict) -> np.ndarray:
    if isinstance(frame.get("world_matrix"), list):
        return np.array(frame["world_matrix"], np.float64).reshape(4, 4)
    from scipy.spatial.transform import Rotation

    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("xyz", frame["rotation"]).as_matrix()
    pose[:3, 3] = frame["position"]
    return pose


def _picture(folder: Path, name: str) -> Path:
    for place in (folder, folder / "png", folder / "exr", folder.parent / "png"):
        for suffix in ("", ".png", ".exr", ".jpg"):
            if pictures.is_picture(place / (name + suffix)):
                return place / (name + suffix)
    raise ExchangeError(f"no such picture, as {JSON} names it", file=folder / name)


def _lens(data: dict, size: tuple[int, int], file: Path) -> tuple:
    """pixel_pitch, delta and sensor_m of a perspective camera, without lens shift."""
    camera = data.get("camera") or {}
    if camera.get("type", "PERSP") != "PERSP":
        raise ExchangeError("only perspective cameras can be read", file=file, key="camera.type")
    try:
        if "focal_length" in camera:
            sensor = float(data["sensor_size"][0]) / 1e3
            extent = sensor / (float(camera["focal_length"]) / 1e3)
            return extent / size[0], 0.0, sensor * max(size) / size[0]
        if "angle" in camera:
            return 2 * math.tan(float(camera["angle"]) / 2) / max(size), 0.0, None
    except (KeyError, TypeError, ValueError, ZeroDivisionError):
        raise ExchangeError("holds no lens that can be read", file=file, key="camera") from None
    return None, 0.0, None


def _read_text(path: Path) -> ViewGrid:
    file = path / TEXT
    try:
        pairs = (line.split(":", 1) for line in file.read_text().splitlines() if ":" in line)
        values = {key.strip(): value.strip() for key, value in pairs}
        columns, rows = int(values["num_x"]), int(values["num_y"])
        base = float(values["base_x"]), float(values["base_y"])
    except (OSError, UnicodeDecodeError, KeyError, ValueError) as error:
        raise ExchangeError(f"lacks num_x, num_y, base_x or base_y: {error}", file=file) from None
    files = [one for one in pictures.pictures_of(path) if folder._TWO.search(one.stem)]
    found = folder.by_numbers(files, path, Order()) if files else None
    if found is None or (len(found[0]), len(found)) != (columns, rows):
        raise ExchangeError(
            f"holds {len(files)} views; {TEXT} asks for {columns} x {rows} named row_column",
            file=path,
        )
    steps = [2 * b / (n - 1) for b, n in zip(base, (columns, rows), strict=True) if n > 1]
    even = steps and max(steps) - min(steps) <= 0.01 * max(steps)
    geometry = Geometry(steps[0] if even else None, None, 0.0)
    notes = (
        () if even or not steps else ("steps across and down differ: the spacing was not imported",)
    )
    grid = folder.of_files(found, path.name, geometry=geometry, notes=notes)
    return grid.turned(left=True, up=True)


def write(source: Source, folder: Path, options: WriteOptions) -> None:
    """Write IDLab's plane: pictures in ``png``, poses in ``lightfield.json``; z is up."""
    from scipy.spatial.transform import Rotation

    geometry = source.require_geometry(JSON)
    half, views = parallel_views(source, options)
    width, height = 2 * half[0], 2 * half[1]
    (folder / "png").mkdir()
    frames = []
    for column, row, picture in views:
        name = f"view_{row * source.columns + column:04d}f"
        write_picture(folder / "png" / f"{name}.png", picture)
        pose = TO_WORLD @ source.pose(column, row)
        turn = Rotation.from_matrix(pose[:3, :3]).as_euler("xyz")
        frames.append({
            "name": name, "position": pose[:3, 3].tolist(), "rotation": turn.tolist(),
            "world_matrix": pose.tolist(),
        })  # fmt: skip
    pixel_mm = 1e3 * geometry.sensor_m / max(source.width, source.height)
    camera = {
        "type": "PERSP", "lens_unit": "MILLIMETERS", "focal_length": pixel_mm * source.focal_px,
    }  # fmt: skip
    data = {
        "camera": camera, "lf_type": "PLANE", "resolution": [width, height],
        "sensor_size": [pixel_mm * width, pixel_mm * height], "frames": frames,
    }  # fmt: skip
    write_json(folder / JSON, data)
