"""Pictures with poses in JSON: nerfstudio's ``transforms.json``, and a Blender add-on's.

nerfstudio has OpenGL's axes, and reads a principal point per frame where the file has none for all:
where views coincide at a finite distance, the principal point moves with the camera.
IDLab's add-on has poses, focal length and sensor of a plane in ``lightfield.json``.  Both worlds
have z up.
"""

import math
from pathlib import Path

import numpy as np

from lfcore.exchange import folder as by_file
from lfcore.exchange import pictures, posed
from lfcore.exchange.grid import Geometry, ReadOptions, ViewGrid, WriteOptions
from lfcore.exchange.lenses import Lens
from lfcore.exchange.reading import ExchangeError, existing, load_json, refused
from lfcore.exchange.source import Source
from lfcore.files import write_json
from lfcore.pictures import write_picture

NERFSTUDIO, IDLAB = "transforms.json", "lightfield.json"
TO_WORLD = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
"""The turn from x right, y up, z back to x right, y forward, z up."""
MOST_MM = 65535
"""The largest depth of 16 bits, mm; farther ones are stored as 0, unknown."""


def read_nerfstudio(path: Path, options: ReadOptions) -> ViewGrid:
    file = path / NERFSTUDIO if path.is_dir() else path
    data = load_json(file)
    frames = data.get("frames")
    if not isinstance(frames, list) or not frames:
        raise ExchangeError("holds no frames", file=file, key="frames")
    names = [str(frame.get("file_path", "?")) for frame in frames]
    files = [
        existing([file.parent / (name + end) for end in ("", ".png", ".jpg")], f"{file.name} asks")
        for name in names
    ]
    with refused("is not 4 x 4 in every frame", file, "transform_matrix"):
        poses = np.array([frame["transform_matrix"] for frame in frames], np.float64)
        if poses.shape[1:] not in ((4, 4), (3, 4)):
            raise ValueError
    size = pictures.size_of(files[0])
    lenses = [_nerfstudio_lens({**frame, **data}, size, file) for frame in frames]
    return posed.views(poses, lenses, files, file)


def _nerfstudio_lens(frame: dict, size: tuple[int, int], file: Path) -> Lens:
    """The lens of a frame, with what the file has for all; ``size`` is the picture's."""
    model = "OPENCV_FISHEYE" if frame.get("is_fisheye") else frame.get("camera_model", "OPENCV")
    if str(model) not in posed.LENSES:
        problem = f"{model!r} is none of {', '.join(posed.LENSES)}"
        raise ExchangeError(problem, file=file, key="camera_model")
    width, height = frame.get("w", size[0]), frame.get("h", size[1])
    numbers = {key: frame.get(key, 0.0) for key in ("k1", "k2", "k3", "k4", "p1", "p2")}
    numbers |= {"cx": frame.get("cx", width / 2), "cy": frame.get("cy", height / 2)}
    with refused("is missing, no number, or not positive", file, "fl_x, fl_y, cx, cy, w, h"):
        if "fl_x" not in frame and "camera_angle_x" in frame:
            frame = {**frame, "fl_x": width / 2 / math.tan(float(frame["camera_angle_x"]) / 2)}
        numbers |= {"fx": frame["fl_x"], "fy": frame.get("fl_y", frame["fl_x"])}
        numbers = {key: float(value) for key, value in numbers.items()}
        return Lens.of(numbers, (float(width), float(height)), "FISHEYE" in model)


def write_nerfstudio(source: Source, folder: Path, options: WriteOptions) -> None:
    parallel = source.require_geometry(NERFSTUDIO).delta == 0
    (folder / "images").mkdir()
    if source.has_depth:
        (folder / "depth").mkdir()
    frames = []
    for column, row, picture in source.views(options.progress):
        name = pictures.view_name(column, row)
        write_picture(folder / "images" / name, picture)
        pose = TO_WORLD @ source.pose(column, row)
        frame = {"file_path": f"images/{name}", "transform_matrix": pose.tolist()}
        if not parallel:
            frame |= dict(zip(("cx", "cy"), map(float, source.centre(column, row)), strict=True))
        if source.has_depth:
            # uint16 millimetres; 0, which is "not known", for a miss and beyond 65.5 m.
            mm = np.rint(1e3 * source.depth(column, row)[0].astype(np.float64))
            stored = np.where(mm <= MOST_MM, mm, 0).astype(np.uint16)
            write_picture(folder / "depth" / name, stored)
            frame["depth_file_path"] = f"depth/{name}"
        frames.append(frame)
    shared = {
        "camera_model": "OPENCV", "fl_x": source.focal_px, "fl_y": source.focal_px,
        "w": source.width, "h": source.height, "k1": 0.0, "k2": 0.0, "p1": 0.0, "p2": 0.0,
        "orientation_override": "none",
    }  # fmt: skip
    if parallel:
        shared |= dict(zip(("cx", "cy"), map(float, source.axis_px), strict=True))
    write_json(folder / NERFSTUDIO, {**shared, "frames": frames})
    if not source.has_depth:
        options.notes.append("no depth was written: give the scene to add it")


def read_blender(path: Path, options: ReadOptions) -> ViewGrid:
    file = path / IDLAB
    data = load_json(file)
    kind = data.get("lf_type", "PLANE")
    if kind != "PLANE":
        problem = f"is a light field on a {str(kind).lower()}; only planes can be read"
        raise ExchangeError(problem, file=file, key="lf_type")
    with refused("lacks names, positions or rotations", file, "frames"):
        names = [str(frame["name"]) for frame in data["frames"]]
        poses = np.array([_idlab_pose(frame) for frame in data["frames"]], np.float64)
        if not names or poses.shape[1:] != (4, 4):
            raise ValueError
    grid = posed.on_a_plane(poses, file, names)
    folder = file.parent
    places = folder, folder / "png", folder / "exr", folder.parent / "png"
    ends = "", ".png", ".exr", ".jpg"
    files = [
        existing([place / (name + end) for place in places for end in ends], f"{IDLAB} names it")
        for name in names
    ]
    size = pictures.size_of(files[0])
    placed = [[files[k] for k in line] for line in grid.index]
    geometry = Geometry(grid.pitch, *_idlab_lens(data, size, file))
    return by_file.of_files(placed, folder.resolve().name, geometry=geometry)


def _idlab_pose(frame: dict) -> np.ndarray:
    if isinstance(frame.get("world_matrix"), list):
        return np.array(frame["world_matrix"], np.float64).reshape(4, 4)
    from scipy.spatial.transform import Rotation

    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("xyz", frame["rotation"]).as_matrix()
    pose[:3, 3] = frame["position"]
    return pose


def _idlab_lens(data: dict, size: tuple[int, int], file: Path) -> tuple:
    """pixel_pitch, delta and sensor_m of a perspective camera, without lens shift."""
    camera = data.get("camera") or {}
    with refused("holds no lens that can be read", file, "camera"):
        if camera.get("type", "PERSP") != "PERSP":
            problem = "only perspective cameras can be read"
            raise ExchangeError(problem, file=file, key="camera.type")
        if "focal_length" in camera:
            sensor = float(data["sensor_size"][0]) / 1e3
            extent = sensor / (float(camera["focal_length"]) / 1e3)
            return extent / size[0], 0.0, sensor * max(size) / size[0]
        if "angle" in camera:
            return 2 * math.tan(float(camera["angle"]) / 2) / max(size), 0.0, None
    return None, 0.0, None


def write_blender(source: Source, folder: Path, options: WriteOptions) -> None:
    """Write IDLab's plane: pictures in ``png``, poses in ``lightfield.json``."""
    from scipy.spatial.transform import Rotation

    geometry = source.require_geometry(IDLAB)
    half, views = posed.parallel_views(source, options)
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
    write_json(folder / IDLAB, data)
