"""Light fields of other programs, with one damaged file or file name."""

import re
import shutil
import zlib
from collections.abc import Sequence
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from hypothesis import strategies as st

from lfcore.exchange.exporting import export_lightfield
from lfcore.exchange.grid import Geometry, ReadOptions, ViewGrid
from lfcore.exchange.importing import read_grid, store_grid
from lfcore.exchange.pictures import is_picture
from lfcore.exchange.table import FORMATS
from robustness.inputs import Inputs, damaged_bytes, damaged_json, damaged_text
from robustness.outcome import Outcome, SilentlyWrong, outcome_of
from robustness.targets import Target, seeds_folder
from robustness.targets.stores import CODECS

KNOWN = Geometry(pitch_m=0.004, pixel_pitch=0.02, delta=0.5, sensor_m=0.036)
"""The geometry of the seeds."""
GRID = (3, 3)
"""The columns and rows of the seeds' views."""
TEXTS = (".json", ".cfg", ".txt")
"""The suffixes of text files."""
UNRECOGNISED = ("eslf", "mosaic", "folder")
"""The formats that are read only by name."""
PICTURES_PER_FORMAT = 2
"""The pictures of a format that are seeds; the others are alike."""
MOST_PIXELS = 1 << 22
"""The most pixels of a grid whose views are read."""


def seeds_of_a_child(folder: Path) -> list[bytes]:
    """Return :func:`seeds` from another process, as exporting opens a device.

    A device starts threads that forked children lack; these would wait for them forever.
    """
    with get_context("fork").Pool(1) as pool:
        return pool.apply(seeds, (folder,))


def seeds(folder: Path) -> list[bytes]:
    """Valid inputs: the name of a file below ``folder``, a line end, and the file's content."""
    shape = (*GRID, 16, 16, 3)
    noise = np.random.default_rng(1).integers(0, 256, shape, np.uint8)
    views = ViewGrid.of_array(noise, "noise", format="noise", geometry=KNOWN)
    store_grid(folder / "noise.mkv", views, CODECS["ffv1"])
    whole = []
    for name, row in FORMATS.items():
        if not row.imports or name == "hdf5":  # hdf5 needs another package
            continue
        if name == "folder":
            shutil.copytree(folder / "blender" / "png", folder / name)
        elif name == "llff":
            shutil.copytree(folder / "blender" / "png", folder / name / "images")
            np.save(folder / name / "poses_bounds.npy", llff_poses(*GRID))
        else:
            export_lightfield(folder / "noise.mkv", name, folder / name)
        files = _files(folder / name)
        pictures = [path for path in files if is_picture(path)]
        for file in [path for path in files if path not in pictures[PICTURES_PER_FORMAT:]]:
            whole.append(f"{file.relative_to(folder)}\n".encode() + file.read_bytes())
    return whole


def llff_poses(columns: int, rows: int) -> np.ndarray:
    """Return the rows of LLFF's ``poses_bounds.npy``: axes down, right and back, position, size and
    depths."""
    lens = np.array([16.0, 16.0, 50.0])
    matrices = [
        np.column_stack([[0, -1, 0], [1, 0, 0], [0, 0, 1], [0.04 * k, -0.04 * j, 0], lens])
        for j in range(rows) for k in range(columns)
    ]  # fmt: skip
    return np.array([np.append(matrix.ravel(), (1.0, 2.0)) for matrix in matrices])


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file())


def damaged(seeds: Sequence[bytes]) -> Inputs:
    """Return seeds with another content, by its kind, or another name."""
    return st.sampled_from(seeds).flatmap(_damaged_file)


def _damaged_file(seed: bytes) -> Inputs:
    name, _, contents = seed.partition(b"\n")
    head, _, tail = name.partition(b"/")
    names = damaged_text([tail]).map(lambda text: re.sub(rb"[\n\0]", b"", text)[:200])
    damage = damaged_text if name.decode().endswith(TEXTS) else damaged_bytes
    damage = damaged_json if name.endswith(b".json") else damage
    renamed = names.map(lambda changed: head + b"/" + changed + b"\n" + contents)
    return damage([contents]).map(lambda changed: name + b"\n" + changed) | renamed


def judge(data: bytes, folder: Path) -> Outcome:
    """Read every view of the folder with this file in place of the original."""
    name, _, contents = data.partition(b"\n")
    format_name = name.partition(b"/")[0].decode("utf-8", "replace")
    if format_name not in FORMATS:
        return Outcome("refused")
    home, source = seeds_folder(folder), folder / "source"
    shutil.rmtree(source, ignore_errors=True)
    shutil.copytree(home / format_name, source)
    names = [bytes(file.relative_to(home)) for file in _files(home / format_name)]
    if name not in names:  # a changed name: the file replaces the last one
        _files(source)[-1].unlink()
    try:
        path = source / name.partition(b"/")[2].decode("utf-8", "surrogateescape")
        if not path.resolve().is_relative_to(source.resolve()):
            return Outcome("refused")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(contents)
    except (OSError, ValueError):
        return Outcome("refused")  # no file can have that name
    # Formats that cannot be recognised are always named, others half of the time.
    is_named = format_name in UNRECOGNISED or zlib.crc32(data) % 2
    named = format_name if is_named else None
    return outcome_of(lambda: _read(source, named), names=None)


def _read(source: Path, named: str | None) -> None:
    options = ReadOptions(views=GRID if named in UNRECOGNISED else None)
    grid = read_grid(source, named, options)
    if min(grid.columns, grid.rows, grid.width, grid.height) < 1:
        raise SilentlyWrong("a grid without views or pixels")
    geometry = (grid.geometry.pitch_m, grid.geometry.pixel_pitch, grid.geometry.delta)
    if not all(value is None or np.isfinite(value) for value in geometry):
        raise SilentlyWrong(f"a geometry {geometry}")
    if grid.columns * grid.rows * grid.width * grid.height > MOST_PIXELS:
        return
    for row, column in np.ndindex(grid.rows, grid.columns):
        view = grid.read(column, row)
        if view.shape != (grid.height, grid.width, 3):
            raise SilentlyWrong(f"a view {view.shape} {view.dtype}")


def targets() -> list[Target]:
    return [Target("import", seeds_of_a_child, damaged, judge)]
