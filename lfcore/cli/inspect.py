"""``lfcore info``, ``lfcore view`` and ``lfcore devices``."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

from lfcore.cli.command import add_command
from lfcore.cli.progress import progress, say
from lfcore.cli.refocus import open_field
from lfcore.pictures import check_suffix, write_picture
from lfcore.storage.codecs import LOSSLESS

INFO = """\
Say what a light field file holds: lens, resolutions, layout, codec, segments, size."""
INFO_EPILOG = """\
examples:
  lfcore info bike.mkv
  lfcore info bike.mkv --verify     read every byte and compare with the check sums
  lfcore info bike.mkv --json       the metadata, for programs
"""
VIEW = """\
Take one view (the picture from one point of the lens) or one macropixel (what one pixel sees
through the whole lens) out of a light field file. Only what is needed is decoded."""
VIEW_EPILOG = """\
examples:
  lfcore view bike.mkv -o centre.png                 the central view
  lfcore view bike.mkv --view 0 15 -o corner.png     lens column 0, row 15
  lfcore view bike.mkv --macropixel 64 32 -o lens.png  of pixel column 64, row 32
  lfcore view bike.mkv --grid 5 -o sheet.png         5 x 5 views, evenly from the whole lens
"""


def add_parser(commands, name: str, summary: str) -> None:
    if name == "devices":
        command = add_command(commands, name, summary, _DEVICES)
        command.set_defaults(run=devices)
        return
    text = (INFO, INFO_EPILOG) if name == "info" else (VIEW, VIEW_EPILOG)
    command = add_command(commands, name, summary, *text)
    command.add_argument("lightfield", type=Path, help="light field file, .mkv")
    command.add_argument("--salvage", action="store_true", help="open a damaged file, too")
    if name == "info":
        command.add_argument("--verify", action="store_true", help="check every segment")
        command.add_argument("--json", action="store_true", help="print the metadata as JSON")
        command.set_defaults(run=info)
        return
    command.add_argument("-o", "--output", type=Path, required=True, help="picture to write")
    what = command.add_mutually_exclusive_group()
    what.add_argument("--view", nargs=2, type=int, metavar=("I", "J"), help="lens column and row")
    what.add_argument("--macropixel", nargs=2, type=int, metavar=("U", "V"), help="column, row")
    what.add_argument("--grid", type=int, metavar="K", help="K x K views side by side")
    command.set_defaults(run=view)


_DEVICES = "List the OpenCL devices that can be used. LFCORE_DEVICE or --device chooses by name."


def devices(arguments: argparse.Namespace) -> None:
    from lfcore.opencl.device import open_device, usable_devices

    chosen = open_device().device
    for device in usable_devices():
        mark = "*" if device == chosen else " "
        memory = device.global_mem_size / 2**30
        print(
            f"{mark} {device.name.strip()} ({device.platform.name.strip()}), "
            f"{device.max_compute_units} compute units, {memory:.1f} GiB"
        )


def info(arguments: argparse.Namespace) -> None:
    field = open_field(arguments)
    if arguments.verify:
        with progress("checking", "segments") as report:
            field.verify(report)
    if arguments.json:
        print(json.dumps(json.loads(field.metadata.to_text()), indent=2))
        return
    for name, value in facts(field).items():
        print(f"{name:<15} {value}")


def facts(field) -> dict[str, str]:
    """What ``lfcore info`` prints, name and value."""
    metadata, layout = field.metadata, field.layout
    size = field.path.stat().st_size
    (columns, rows), (width, height) = field.grid, field.picture_size
    rays = columns * rows * width * height
    found = {"file": str(field.path), "scene": str(metadata.scene.get("name")), **_optics(field)}
    found |= {
        "resolution": f"{width} x {height} pixels, {columns} x {rows} views, {rays:,} rays",
        "layout": f"{layout.kind}, {layout.order}, {layout.elements_per_frame} a frame, "
        f"{metadata.frames} frames of {layout.frame_width} x {layout.frame_height}",
        "codec": f"{metadata.codec}, {layout.pixel_format}{_settings(metadata.settings)}",
        "segments": f"{len(metadata.segments)}, damaged: {len(field.damage)}",
        "size": f"{size:,} bytes, {8 * size / rays:.4f} bits a ray, "
        f"1 : {3 * rays / size:.1f} of 8-bit RGB",
        "software": metadata.software,
    }
    return found


def _settings(settings: dict) -> str:
    """What was said to the encoder: files of lossless ones hold a rate factor that these ignore."""
    keys = ("preset",) if settings.get("codec") in LOSSLESS else ("crf", "preset")
    said = [f"{key} {settings[key]}" for key in keys if settings.get(key) is not None]
    return ", " + ", ".join(said) if said else ""


def _optics(field) -> dict[str, str]:
    if field.array is not None:
        array, (nx, ny) = field.array, field.array.cameras
        columns, rows = array.columns_m, array.rows_m
        return {
            "geometry": f"camera array, {nx} x {ny} of {array.fov_deg:g} degrees, x {columns[0]:g} "
            f"to {columns[-1]:g} m, y {rows[0]:g} to {rows[-1]:g} m down",
            "white": f"radiance {field.white:g}",
        }
    slab, camera = field.slab, field.slab.camera
    source = field.content.get("source", {}).get("format")
    found = {"from": f"imported, {source}"} if source else {}
    if not field.metric:
        return found | {"geometry": "not known: refocus by --disparity"}
    found |= {
        "lens": f"{1e3 * camera.focal_length_m:g} mm f/{camera.f_number:g}, "
        f"sensor {1e3 * camera.sensor_width_m:g} mm",
        "focus": f"{camera.focus_distance_m:g} m",
        "views": f"{1e3 * slab.lens_pitch_m:.4g} mm apart",
    }
    if field.depth_range:
        near, far = field.depth_range
        px = [field.disparity_of(end) for end in (far, near)]
        found["depth"] = f"{near:.4g} to {far:.4g} m, disparities {px[0]:.3g} to {px[1]:.3g} pixels"
    return found


def view(arguments: argparse.Namespace) -> None:
    check_suffix(arguments.output)
    field = open_field(arguments)
    if arguments.macropixel:
        picture = field.macropixel(*arguments.macropixel)
    elif arguments.grid:
        picture = _grid(field, arguments.grid)
    else:
        picture = field.view(*(arguments.view or (side // 2 for side in field.grid)))
    write_picture(arguments.output, picture)
    say(f"wrote {arguments.output}; {field.count.frames} frames were decoded")


def _grid(field, count: int) -> np.ndarray:
    """``count`` x ``count`` views side by side, from corner to corner of the lens."""
    from lfcore.refocus.views import read_views

    chosen = [_spread(count, there) for there in field.grid]
    samples = np.array([(i, j) for j in chosen[1] for i in chosen[0]])
    with progress("reading views", "frames") as report:
        light = read_views(field, samples, progress=report)
    width, height = field.picture_size
    cells = light.reshape(count, count, height, width, 3).transpose(0, 2, 1, 3, 4)
    return cells.reshape(count * height, count * width, 3)


def _spread(count: int, views: int) -> np.ndarray:
    """``count`` of ``views`` columns or rows, from end to end."""
    from lfcore.errors import OpticsError

    if not 1 <= count <= views:
        raise OpticsError(f"must be from 1 to {views}, not {count}", key="--grid")
    if count == 1:
        return np.array([views // 2])
    return np.rint(np.linspace(0, views - 1, count)).astype(int)
