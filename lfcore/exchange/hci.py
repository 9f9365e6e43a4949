"""The HCI 4D Light Field Benchmark: views, parameters.cfg, depth and disparity as float maps.

Honauer, Johannsen, Kondermann, Goldluecke, "A Dataset and Evaluation Methodology for Depth
Estimation on 4D Light Fields", ACCV 2016.  Cameras are parallel with shifted lenses, row 0 on top.
With focal length f, baseline b, sensor width S behind the longer side of w pixels, and focus F, a
point at depth Z has the disparity ``b f w / S (1 / Z - 1 / F)`` pixels, as in a slab.
"""

import configparser
import io
import math
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.exchange import pictures
from lfcore.exchange.grid import Geometry, ReadOptions, ViewGrid, WriteOptions
from lfcore.exchange.reading import ExchangeError, existing, read_text, refused, unreadable
from lfcore.exchange.source import Source
from lfcore.files import write_text
from lfcore.optics.grid_geometry import KnownGeometry
from lfcore.pictures import write_picture

CONFIG = "parameters.cfg"
FSTOP = 100.0
"""The f-number that is written: each view is a pinhole's."""


def read_hci(path: Path, options: ReadOptions) -> ViewGrid:
    file, config = path / CONFIG, configparser.ConfigParser(interpolation=None)
    try:
        config.read_string(read_text(file))
    except configparser.Error as error:
        raise unreadable(file, error) from None

    def number(section: str, key: str) -> float:
        with refused("is missing, or no finite number", file, f"{section}.{key}"):
            value = float(config[section][key])
            if not math.isfinite(value):
                raise ValueError
        return value

    columns, rows = (int(number("extrinsics", f"num_cams_{axis}")) for axis in "xy")
    width, height = (int(number("intrinsics", f"image_resolution_{axis}_px")) for axis in "xy")
    size = width, height
    if min(columns, rows, *size) < 1:
        raise ExchangeError("has no views or no pixels", file=file)
    source = f"{CONFIG} lists {columns * rows} views"
    names = [
        f"input_Cam{{:0{digits}d}}{end}" for digits in (3, 4, 5, 6) for end in (".png", ".jpg")
    ]
    files = [
        existing([path / name.format(k) for name in names], source) for k in range(columns * rows)
    ]
    focus = number("extrinsics", "focus_distance_m")
    sensor, focal = (
        number("intrinsics", key) / 1e3 for key in ("sensor_size_mm", "focal_length_mm")
    )
    for key, value in (("sensor_size_mm", sensor), ("focal_length_mm", focal)):
        if not value > 0:
            raise ExchangeError("must be positive", file=file, key=key)
    geometry = Geometry(
        number("extrinsics", "baseline_mm") / 1e3, sensor / focal / max(size),
        1 / focus if focus else 0.0, sensor,
    )  # fmt: skip
    return ViewGrid(
        columns, rows, width, height, lambda i, j: pictures.read(files[j * columns + i], size),
        config.get("meta", "scene", fallback="") or path.name, geometry=geometry,
        depth_m=_depths(path),
    )  # fmt: skip


def _depths(path: Path) -> tuple[float, float] | None:
    for name in ("gt_depth_lowres.pfm", "gt_depth_highres.pfm"):
        if (path / name).is_file():
            depth = pictures.read_pfm(path / name)
            depth = depth[np.isfinite(depth) & (depth > 0)]
            return (float(depth.min()), float(depth.max())) if depth.size else None
    return None


def write_hci(source: Source, folder: Path, options: WriteOptions) -> None:
    geometry = source.require_geometry("parameters.cfg")
    total = source.columns * source.rows
    digits = max(3, len(str(total - 1)))
    names = [f"Cam{index:0{digits}d}" for index in range(total)]
    for column, row, picture in source.views(options.progress):
        index = row * source.columns + column
        write_picture(folder / f"input_{names[index]}.png", picture)
    reach = source.field.depth_range
    if source.has_depth:
        reach = _write_depth(source, folder, names)
    else:
        options.notes.append(
            "no depth was written: give the scene to add depth and disparity of every view"
        )
    if reach is None:
        options.notes.append(
            "parameters.cfg lacks disp_min and disp_max, which the benchmark's own readers need: "
            "the light field does not hold its range of depths"
        )
    if source.columns != source.rows:
        options.notes.append("the benchmark's own readers accept square grids only")
    write_text(folder / CONFIG, parameters(source, geometry, reach))


def _write_depth(source: Source, folder: Path, names: list[str]) -> tuple[float, float] | None:
    """Write depth, disparity and, with the scene, materials of every view.

    The middle view also gets short names.  Returns the nearest and farthest depth,
    infinity where a ray misses.
    """
    middle = (source.rows // 2) * source.columns + source.columns // 2
    near, far = math.inf, 0.0
    for index, name in enumerate(names):
        depth, ids = source.depth(index % source.columns, index // source.columns)
        near, far = min(near, float(depth.min())), max(far, float(depth.max()))
        for suffix in (f"_{name}", "") if index == middle else (f"_{name}",):
            for size in ("lowres", "highres"):
                write_picture(folder / f"gt_depth_{size}{suffix}.pfm", depth)
                write_picture(folder / f"gt_disp_{size}{suffix}.pfm", source.disparity(depth))
            if ids is not None:
                write_picture(folder / f"objectids_highres{suffix}.png", ids)
    return (near, far) if near < math.inf else None


def parameters(source: Source, geometry: KnownGeometry, reach: tuple[float, float] | None) -> str:
    """The text of parameters.cfg; ``reach`` has the nearest and farthest depth, metres."""
    focal = geometry.sensor_m / (geometry.pixel_pitch * max(source.width, source.height))
    meta: dict[str, Any] = {"scene": source.name, "category": "synthetic", "date": "",
                            "version": "v0", "authors": "", "contact": ""}  # fmt: skip
    if reach:
        high, low = source.disparity(np.array(reach, np.float64)).tolist()
        for prefix in ("", "frustum_"):
            meta |= {f"{prefix}disp_min": low, f"{prefix}disp_max": high}
    meta["depth_map_scale"] = 1.0
    config, text = configparser.ConfigParser(interpolation=None), io.StringIO()
    config.read_dict({
        "intrinsics": {
            "focal_length_mm": 1e3 * focal,
            "image_resolution_x_px": source.width,
            "image_resolution_y_px": source.height,
            "sensor_size_mm": 1e3 * geometry.sensor_m,
            "fstop": FSTOP,
        },
        "extrinsics": {
            "num_cams_x": source.columns,
            "num_cams_y": source.rows,
            "baseline_mm": 1e3 * geometry.pitch_m,
            "focus_distance_m": 1 / geometry.delta if geometry.delta else 0.0,
            **{f"center_cam_{axis}_m": 0.0 for axis in "xyz"},
            **{f"center_cam_r{axis}_rad": 0.0 for axis in "xyz"},
        },
        "meta": meta,
    })  # fmt: skip
    config.write(text)
    return text.getvalue()
