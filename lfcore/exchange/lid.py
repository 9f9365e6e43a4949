"""Stanford's lightpack: a ``.lid`` text that names two planes, and SGI pictures ``base.u.v.rgb``.

    SLAB 0 base          SLAB_UV x y z w u v   four corners of the plane of the cameras
    SAMPLES_UV nu nv     SLAB_ST x y z w s t   four corners of the plane of the pictures
    SAMPLES_ST ns nt     w = 0 is a plane at infinity, whose x y z are directions

Here u and s run to the right, v and t upwards, the world has y up and z backwards; cameras stand on
the corners of UV, and the corners of ST are the outer corners of pixels.  Levoy and Hanrahan,
"Light Field Rendering", SIGGRAPH 1996.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lfcore.exchange import folder as by_file
from lfcore.exchange import pictures
from lfcore.exchange.exporting import WriteOptions
from lfcore.exchange.grid import MOST_VIEWS, ExchangeError, Geometry, ViewGrid
from lfcore.exchange.importing import ReadOptions
from lfcore.exchange.source import Source
from lfcore.files import write_text

HEADER = "# LIF1.0"
CORNERS = ((0, 0), (1, 0), (1, 1), (0, 1))
_LIKE = 1e-3


def _lid(path: Path) -> Path | None:
    if path.suffix.lower() == ".lid":
        return path
    found = sorted(path.glob("*.lid")) if path.is_dir() else []
    return found[0] if len(found) == 1 else None


def recognise(path: Path) -> bool:
    return _lid(path) is not None


def read(path: Path, options: ReadOptions) -> ViewGrid:
    file = _lid(path)
    if file is None:
        raise ExchangeError("holds not one .lid file", file=path)
    words = _words(file)
    if len(words.get("SLAB", ())) != 1:
        raise ExchangeError(
            f"describes {len(words.get('SLAB', ()))} slabs; one can be read", file=file, key="SLAB"
        )
    base = words["SLAB"][0][1]
    (columns, rows), _ = (_counts(words, key, file) for key in ("SAMPLES_UV", "SAMPLES_ST"))
    files = []
    for row in range(rows):
        line = [file.parent / f"{base}.{u}.{rows - 1 - row}.rgb" for u in range(columns)]
        for view in line:
            if not view.is_file():
                raise ExchangeError(f"no such file; {file.name} asks for {columns} x {rows} views",
                                    file=view)  # fmt: skip
        files.append(line)
    size = pictures.size_of(files[0][0])
    uv, st = (_plane(words, key, file) for key in ("SLAB_UV", "SLAB_ST"))
    geometry, notes = _geometry(uv, st, columns, rows, size)
    return by_file.of_files(files, base, geometry=geometry, notes=notes)


def _words(file: Path) -> dict[str, list[list[str]]]:
    """Lines by their first word."""
    try:
        lines = file.read_text(encoding="ascii").splitlines()
    except (OSError, UnicodeDecodeError):
        raise ExchangeError("cannot be read as text", file=file) from None
    out: dict[str, list[list[str]]] = {}
    for line in lines:
        key, *rest = line.split("#")[0].split() or [""]
        if key:
            out.setdefault(key, []).append(rest)
    if any(len(rest) < 2 for rest in out.get("SLAB", ())):
        raise ExchangeError("lacks number or name", file=file, key="SLAB")
    return out


def _counts(words: dict, key: str, file: Path) -> tuple[int, int]:
    try:
        across, down = (int(word) for word in words[key][0][-2:])
        if min(across, down) < 1 or max(across, down) > MOST_VIEWS:
            raise ValueError
    except (KeyError, IndexError, ValueError):
        raise ExchangeError("is missing or not two counts", file=file, key=key) from None
    return across, down


def _plane(words: dict, key: str, file: Path) -> np.ndarray:
    """(2, 2, 4) corners, indexed [v, u]: x y z w."""
    out = np.full((2, 2, 4), np.nan)
    try:
        for line in words[key]:
            *corner, u, v = (float(word) for word in line[-6:])
            out[round(v), round(u)] = corner
    except (KeyError, ValueError, IndexError):
        out[...] = np.nan
    if not np.isfinite(out).all():
        raise ExchangeError("has not four corners x y z w u v", file=file, key=key)
    return out


def _geometry(
    uv: np.ndarray, st: np.ndarray, columns: int, rows: int, size: tuple[int, int]
) -> tuple[Geometry, tuple[str, ...]]:
    """Of planes that face each other; what is not that of a slab stays unknown."""
    across, up = uv[0, 1, :3] - uv[0, 0, :3], uv[1, 0, :3] - uv[0, 0, :3]
    steps = [np.linalg.norm(side) / (n - 1)
             for side, n in ((across, columns), (up, rows)) if n > 1]  # fmt: skip
    if (uv[..., 3] == 0).any() or not steps or np.ptp(steps) > _LIKE * max(steps):
        return Geometry(), ("the plane of the cameras is no even grid: its spacing is not known",)
    pitch = float(np.mean(steps))
    right = (across if columns > 1 else st[0, 1, :3] - st[0, 0, :3]).copy()
    right /= np.linalg.norm(right)
    higher = (up if rows > 1 else st[1, 0, :3] - st[0, 0, :3]).copy()
    higher /= np.linalg.norm(higher)
    back = np.cross(right, higher)
    width = abs((st[0, 1, :3] - st[0, 0, :3]) @ right)
    if (st[..., 3] == 0).all():
        depth = abs(float(st[0, 0, :3] @ back))
        delta = 0.0
    else:
        depth = abs(float((st[0, 0, :3] - uv[0, 0, :3]) @ back))
        delta = 1 / depth if depth else 0.0
    if not depth:
        return Geometry(pitch), ("the two planes coincide: focus and field of view are not known",)
    return Geometry(pitch, float(width / depth / size[0]), delta), ()


def write(source: Source, folder: Path, options: WriteOptions) -> None:
    geometry = source.require_geometry("a .lid")
    last = source.rows - 1
    for column, row, picture in source.views(options.progress):
        pictures.write(folder / f"{source.name}.{column}.{last - row}.rgb", picture)
    place = source.columns_m[[0, -1]], -source.rows_m[[-1, 0]]
    # Where the corners of a picture's pixels lie on the plane at which the views coincide, or in
    # which direction: the same for all cameras.
    cx, cy = source.axis_px
    x = (np.array([0, source.width]) - cx) * geometry.pixel_pitch
    y = -(np.array([source.height, 0]) - cy) * geometry.pixel_pitch
    depth, w = (1 / geometry.delta, 1) if geometry.delta else (1.0, 0)
    lines = [HEADER, f"SLAB 0 {source.name}"]
    for u, v in CORNERS:
        lines.append(f"SLAB_UV {place[0][u]:.9g} {place[1][v]:.9g} 0 1 {u} {v}")
    for s, t in CORNERS:
        lines.append(
            f"SLAB_ST {x[s] * depth:.9g} {y[t] * depth:.9g} {-depth:.9g} {w} {s} {t}"
        )  # fmt: skip
    lines += [f"SAMPLES_UV {source.columns} {source.rows}",
              f"SAMPLES_ST {source.width} {source.height}", "FORMAT rgb"]  # fmt: skip
    write_text(folder / f"{source.name}.lid", "\n".join(lines) + "\n")
