"""Cameras with poses: parallel cameras on a grid in one plane are a light field.

- COLMAP's text model has one PINHOLE camera per image, so that principal points are exact, and
  x right, y down, z forward, without rotation.
- A row of LLFF's ``poses_bounds.npy`` is a 3 x 5 matrix, camera to world with the axes [down,
  right, backwards], the position, and (height, width, focal length), then the nearest and farthest
  depth.  It has no principal point: views that coincide at a finite distance are cropped about
  their axes, to the whole pixel.

Their unit is read as metres.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lfcore.exchange import pictures
from lfcore.exchange.grid import Geometry, ReadOptions, ViewGrid, WriteOptions
from lfcore.exchange.lenses import Lens, as_pinholes
from lfcore.exchange.reading import ExchangeError, existing, read_text, refused, unreadable
from lfcore.exchange.source import Source, View
from lfcore.files import write_text
from lfcore.pictures import write_picture

_TURNED = 1e-3
"""The largest difference of rotation matrices of parallel cameras, per entry."""
_APART = 1e-2
"""The largest deviation of cameras from a plane and from even steps, in steps; half of it, in the
grid's size, parts columns and rows."""
_FARTHEST = 1e12
"""The largest number of a pose."""
MODEL = Path("sparse") / "0"
LENSES = {
    "SIMPLE_PINHOLE": "f cx cy", "PINHOLE": "fx fy cx cy", "SIMPLE_RADIAL": "f cx cy k1",
    "RADIAL": "f cx cy k1 k2", "OPENCV": "fx fy cx cy k1 k2 p1 p2",
    "FULL_OPENCV": "fx fy cx cy k1 k2 p1 p2 k3 d1 d2 d3",
    "OPENCV_FISHEYE": "fx fy cx cy k1 k2 k3 k4", "SIMPLE_RADIAL_FISHEYE": "f cx cy k1",
    "RADIAL_FISHEYE": "f cx cy k1 k2",
}  # fmt: skip
"""The parameters of COLMAP's camera models, by the names of :meth:`Lens.of`."""
POSES = "poses_bounds.npy"


@dataclass(frozen=True)
class PosedGrid:
    """Poses on a grid.

    Attributes
    ----------
    index : ndarray
        (rows, columns) numbers of the poses.
    x, y : ndarray
        Positions of columns and rows along the cameras' axes, x right and y down.
    pitch : float or None
        The distance between neighbours; None if it differs.
    """

    index: np.ndarray
    x: np.ndarray
    y: np.ndarray
    pitch: float | None


def on_a_plane(poses: np.ndarray, file: Path, names: Sequence[str]) -> PosedGrid:
    """Sort cameras (K, 4, 4), camera to world with OpenGL's axes, into a grid."""
    if not (np.abs(poses) < _FARTHEST).all():
        raise ExchangeError("holds poses that are not finite", file=file)
    turn = poses[0, :3, :3] / np.maximum(np.linalg.norm(poses[0, :3, :3], axis=0), 1e-30)
    turned = np.abs(poses[:, :3, :3] - poses[0, :3, :3]).max((1, 2))
    if turned.max() > _TURNED:
        problem = f"{names[int(turned.argmax())]} looks in another direction than {names[0]}"
        raise ExchangeError(problem, file=file, remedy="A light field's cameras are parallel")
    local = (poses[:, :3, 3] - poses[0, :3, 3]) @ turn
    x, y, depth = local[:, 0], -local[:, 1], local[:, 2]
    reach = max(np.ptp(x), np.ptp(y), 1e-30)
    column, columns = _lines(x, reach)
    row, rows = _lines(y, reach)
    if np.ptp(depth) > _APART * reach / max(len(columns), len(rows)):
        odd = names[int(np.abs(depth - np.median(depth)).argmax())]
        raise ExchangeError(f"{odd} is before or behind the plane of the others", file=file)
    index = np.full((len(rows), len(columns)), -1)
    index[row, column] = np.arange(len(poses))
    if len(poses) != index.size or (index < 0).any():
        found = f"{len(columns)} columns and {len(rows)} rows were found"
        raise ExchangeError(f"its {len(poses)} cameras are no full grid: {found}", file=file)
    steps = np.concatenate([np.diff(columns), np.diff(rows)])
    even = len(steps) and np.ptp(steps) <= _APART * steps.mean()
    return PosedGrid(index, columns, rows, float(steps.mean()) if even else None)


def _lines(values: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Cluster values at gaps: the line of each value, and the lines' positions."""
    order = np.argsort(values, kind="stable")
    gap = np.diff(values[order]) > reach * _APART / 2
    line = np.empty(len(values), int)
    line[order] = np.concatenate([[0], np.cumsum(gap)])
    places = np.bincount(line, values) / np.bincount(line)
    return line, places


def views(poses: np.ndarray, lenses: list[Lens], files: list[Path], described: Path) -> ViewGrid:
    """The light field of pictures with poses (K, 4, 4), as for :func:`on_a_plane`, and lenses."""
    grid = on_a_plane(poses, described, [file.name for file in files])
    seen = as_pinholes(lenses, files, described)
    delta, notes = _delta(grid, seen.centres[grid.index], seen.size, seen.focal)
    return ViewGrid(
        len(grid.x), len(grid.y), *seen.size, lambda i, j: seen.read(int(grid.index[j, i])),
        described.resolve().parent.name or "views",
        geometry=Geometry(grid.pitch, 1 / seen.focal, delta), notes=(*seen.notes, *notes),
    )  # fmt: skip


def _delta(
    grid: PosedGrid, centres: np.ndarray, size: tuple[int, int], focal: float
) -> tuple[float | None, tuple[str, ...]]:
    """The inverse distance at which the views coincide, and notes on other principal points."""
    notes, middle = [], centres.mean((0, 1))
    x, y = np.broadcast_arrays(grid.x[None, :], grid.y[:, None])
    place, moved = np.stack([x - x.mean(), y - y.mean()], -1), centres - middle
    power = float(np.sum(place**2))
    slope = float(np.sum(place * moved) / power) if power else 0.0
    off = float(np.abs(moved - slope * place).max())
    beside = np.abs(middle - np.array(size) / 2).max()
    if off > 0.5:
        notes.append(f"principal points are up to {off:.2g} pixels off those of a slab")
    if beside > 0.5:
        notes.append(
            f"the axis is {beside:.3g} pixels off the pictures' middle, and was moved there"
        )
    delta = slope / focal
    if delta < -1e-9 or (off > 0.5 and off > 0.1 * abs(slope) * np.ptp(grid.x)):
        return None, tuple(notes)
    return max(delta, 0.0), tuple(notes)


def parallel_views(source: Source, options: WriteOptions) -> tuple[list[int], Iterator[View]]:
    """Half width and height of all views, and column, row and picture of each.

    Notes say what was cropped.  Raises :class:`ExchangeError` where nothing is left.
    """
    corners = [source.centre(i, j) for i in (0, source.columns - 1) for j in (0, source.rows - 1)]
    size, rounded = np.array([source.width, source.height]), np.rint(corners)
    half = np.minimum(rounded, size - rounded).min(0).astype(int).tolist()
    if min(half) < 1:
        problem = "the views have no part in common about their axes"
        remedy = "Choose fewer views, nearer to the middle, or another format"
        raise ExchangeError(problem, file=source.field.path, remedy=remedy)
    places = [source.centre(i, 0)[0] for i in range(source.columns)]
    places += [source.centre(0, j)[1] for j in range(source.rows)]
    if (off := np.abs(places - np.rint(places)).max()) > 1e-6:
        options.notes.append(f"principal points are up to {off:.2g} pixels off the middle")
    if 2 * half[0] != source.width or 2 * half[1] != source.height:
        options.notes.append(
            f"views were cropped to {2 * half[0]} x {2 * half[1]} about their axes"
        )

    def windows() -> Iterator[View]:
        for column, row, picture in source.views(options.progress):
            cx, cy = (round(value) for value in source.centre(column, row))
            window = picture[cy - half[1] : cy + half[1], cx - half[0] : cx + half[0]]
            yield column, row, np.ascontiguousarray(window)

    return half, windows()


def read_colmap(path: Path, options: ReadOptions) -> ViewGrid:
    from scipy.spatial.transform import Rotation

    cameras = _cameras(path / MODEL / "cameras.txt")
    file = path / MODEL / "images.txt"
    poses, lenses, files = [], [], []
    for line in _image_lines(file):
        with refused(f"has a line that is no image: {line[:60]!r}", file):
            words = line.split(None, 9)  # a name may have spaces
            turn, move = np.array(words[1:5], float), np.array(words[5:8], float)
            lens, name = cameras[words[8]], words[9]
            to_camera = Rotation.from_quat(turn[[1, 2, 3, 0]]).as_matrix()
            pose = np.eye(4)
            # Its cameras look along +z with y down; OpenGL's along -z with y up.
            pose[:3, :3], pose[:3, 3] = to_camera.T * [1, -1, -1], -to_camera.T @ move
        poses.append(pose)
        lenses.append(lens)
        files.append(existing([path / "images" / name], "images.txt asks for it"))
    if not files:
        raise ExchangeError("holds no images", file=file)
    return views(np.array(poses), lenses, files, file)


def _cameras(file: Path) -> dict[str, Lens]:
    """Lenses by the camera's number."""
    lenses = {}
    models = ", ".join(LENSES)
    for line in filter(None, _text_lines(file)):
        problem = f"has a camera that cannot be read: {line[:60]!r}. Models that can be: {models}"
        with refused(problem, file):
            number, model, width, height, *values = line.split()
            numbers = dict(zip(LENSES[model].split(), map(float, values), strict=True))
            lenses[number] = Lens.of(numbers, (float(width), float(height)), "FISHEYE" in model)
    return lenses


def _text_lines(file: Path) -> list[str]:
    """The lines without comments and outer blanks; empty lines are kept."""
    lines = map(str.strip, read_text(file).splitlines())
    return [line for line in lines if not line.startswith("#")]


def _image_lines(file: Path) -> Iterator[str]:
    """The lines of images; each may be followed by a line of points (x, y, number), left out."""
    after_image = False
    for line in _text_lines(file):
        words = line.split()
        is_points = after_image and len(words) % 3 == 0 and all(map(_is_number, words))
        after_image = bool(line) and not is_points
        if after_image:
            yield line


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def write_colmap(source: Source, folder: Path, options: WriteOptions) -> None:
    source.require_geometry("a COLMAP model")
    (folder / MODEL).mkdir(parents=True)
    (folder / "images").mkdir()
    cameras = ["# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]"]
    images = ["# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME", "# POINTS2D[]"]
    for column, row, picture in source.views(options.progress):
        name, number = pictures.view_name(column, row), row * source.columns + column + 1
        write_picture(folder / "images" / name, picture)
        cx, cy = source.centre(column, row)
        lens = f"{source.focal_px:.12g} {source.focal_px:.12g} {cx:.12g} {cy:.12g}"
        cameras.append(f"{number} PINHOLE {source.width} {source.height} {lens}")
        x, y = -source.columns_m[column], -source.rows_m[row]
        images += [f"{number} 1 0 0 0 {x:.12g} {y:.12g} 0 {number} {name}", ""]
    for name, lines in (("cameras", cameras), ("images", images), ("points3D", ["# empty"])):
        write_text(folder / MODEL / f"{name}.txt", "\n".join(lines) + "\n")


def read_llff(path: Path, options: ReadOptions) -> ViewGrid:
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
    counted, files = files, sorted(files)  # as LLFF's own reader
    if len(files) != len(rows):
        raise ExchangeError(f"has {len(rows)} poses for {len(files)} pictures", file=file)
    matrix = rows[:, :15].reshape(-1, 3, 5)
    with refused("has focal lengths or sizes that are not positive", file):
        lenses = [
            Lens.of({"f": f, "cx": w / 2, "cy": h / 2}, (w, h)) for h, w, f in matrix[:, :, 4]
        ]
    down, right, back, place = (matrix[:, :, k] for k in range(4))
    poses = np.stack([right, -down, back, place], -1)
    near, far = float(rows[:, 15].min()), float(rows[:, 16].max())
    found = views(poses, lenses, files, file)
    if counted != files:
        what = f"poses are of pictures in the alphabet's order: {files[0].name}, {files[1].name}"
        found = replace(found, notes=(*found.notes, what))
    return replace(found, depth_m=(near, far)) if 0 < near <= far else found
