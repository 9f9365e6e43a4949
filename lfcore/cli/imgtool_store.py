"""``lfcore imgtool store``, ``tiles``, ``convert``: camera arrays between tiled EXR and video."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.cli import values
from lfcore.cli.command import Command, refuse
from lfcore.cli.film import save_video
from lfcore.cli.options import add, add_encoder, given
from lfcore.cli.progress import progress, wrote
from lfcore.colour import tonemap
from lfcore.errors import OpticsError
from lfcore.optics.array import CameraArray
from lfcore.pictures import ALL_CODED, check_suffix, write_picture

VIDEO = ".mkv"


def add_files(command: argparse.ArgumentParser, input: str, output: str) -> None:
    """The file to read and the file to write, which pbrt's tool has last and ours after ``-o``."""
    command.add_argument("input", type=Path, help=input)
    command.add_argument("last", type=Path, nargs="?", metavar="output", help="the same as -o")
    command.add_argument("-o", "--output", type=Path, help=f"{output} to write")


def output(arguments: argparse.Namespace) -> Path:
    """The file to write; :class:`OpticsError` where there is none, or two."""
    if (arguments.output is None) == (arguments.last is None):
        refuse("--output", "needs one file to write", "Give -o FILE")
    return arguments.output or arguments.last


def add_bits(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--bits", type=int, choices=(16, 32), default=32, help="bits per sample of the EXR (32)"
    )


def add_geometry(command: argparse.ArgumentParser) -> None:
    add = command.add_argument_group("the light field (default: by its header)").add_argument
    add("--camsperdim", nargs=2, type=values.count(), metavar=("X", "Y"), help="cameras (1 1)")
    add("--griddim", nargs=4, type=values.number(), metavar=("XMIN", "XMAX", "YMIN", "YMAX"),
        help="bounding box of the data cameras, metres (0 0 0 0)")  # fmt: skip
    add("--inputfov", type=values.angle, metavar="DEG", help="field of view of data cameras (90)")
    add("--spacing", choices=("ends", "cells"),
        help="outermost cameras on the bounds, or all in the middle of cells (ends)")  # fmt: skip


def geometry(
    arguments: argparse.Namespace, recorded: CameraArray | None, shape: tuple[int, ...]
) -> CameraArray:
    """The array from the header, from flags, or both where they agree.

    Raises :class:`OpticsError` for a contradiction, naming the flag.
    """
    flags = given(arguments, "camsperdim", "griddim", "inputfov", "spacing")
    if recorded is not None:
        _check_agreement(flags, recorded, arguments.input)
        return recorded
    (width, height), cameras = shape[1::-1], flags.get("camsperdim", (1, 1))
    if width % cameras[0] or height % cameras[1]:
        raise OpticsError(
            f"{cameras[0]} x {cameras[1]} cameras do not divide {width} x {height} pixels",
            file=arguments.input, key="--camsperdim",
            remedy="Give the number of cameras that the light field was made with",
        )  # fmt: skip
    return CameraArray.on_grid(
        cameras, flags.get("griddim", (0.0, 0.0, 0.0, 0.0)), flags.get("inputfov", 90.0),
        (width // cameras[0], height // cameras[1]), flags.get("spacing", "ends"),
    )  # fmt: skip


def _check_agreement(flags: dict[str, Any], recorded: CameraArray, file: Path) -> None:
    low_x, high_x, low_y, high_y = recorded.bounds()
    facts: dict[str, Any] = {
        "camsperdim": recorded.cameras, "griddim": (low_x, high_x, -high_y, -low_y),
        "inputfov": recorded.fov_deg, "spacing": "cells" if any(recorded.margin_m) else "ends",
    }  # fmt: skip
    for name, value in flags.items():
        fact = facts[name]
        same = value == fact if name == "spacing" else np.allclose(value, fact, 1e-5, 1e-9)
        if not same:
            raise OpticsError(
                f"contradicts the header, which says {fact}", file=file, key=f"--{name}",
                remedy="Leave the flag out",
            )  # fmt: skip


def read_lightfield(path: Path) -> tuple[np.ndarray, CameraArray | None, dict[str, Any]]:
    """Picture, geometry if there is any, and other metadata, from EXR or video."""
    if path.suffix.lower() != VIDEO:
        from lfcore.storage.tiled_exr import read_array

        found = read_array(path)
        return found.image, found.array, found.extra
    from lfcore.refocus.array.stored import read_stored
    from lfcore.storage.lightfield import LightFieldFile

    field = LightFieldFile.open(path)
    with progress("reading views", "frames") as report:
        image, array = read_stored(field, progress=report)
    return image, array, {"scene": field.metadata.scene["name"]}


def store(arguments: argparse.Namespace) -> None:
    """EXR to video."""
    check_suffix(arguments.input, (".exr",), "input")
    arguments.output = output(arguments)
    image, recorded, extra = read_lightfield(arguments.input)
    array = geometry(arguments, recorded, image.shape)
    name = str(extra.get("scene", arguments.input.stem))
    save_video(arguments, image, array, name=name)


def tiles(arguments: argparse.Namespace) -> None:
    """Video to EXR, with the geometry in its header."""
    from lfcore.storage.tiled_exr import write_array

    path = output(arguments)
    check_suffix(arguments.input, (VIDEO,), "input")
    check_suffix(path, (".exr",), "output")
    image, array, extra = read_lightfield(arguments.input)
    assert array is not None  # a video always has one
    write_array(path, image, array, half=arguments.bits == 16, extra=extra)
    wrote(path, f": {array.cameras[0]} x {array.cameras[1]} tiles of {array.tile}")


def convert(arguments: argparse.Namespace) -> None:
    """Write a linear EXR as an 8-bit sRGB picture.

    Raises :class:`LfcoreError` when either file is at fault.
    """
    from lfcore.exr import read_exr_picture

    path = output(arguments)
    check_suffix(path, ALL_CODED, "output")
    image = np.nan_to_num(read_exr_picture(arguments.input).astype(np.float64)) * arguments.scale
    write_picture(path, tonemap(image) if arguments.tonemap else image)
    wrote(path, f": {image.shape[1]} x {image.shape[0]}")


def _convert_options(command: argparse.ArgumentParser) -> None:
    add_files(command, "EXR to read", "picture")
    more = command.add_argument
    more("--tonemap", action="store_true",
         help="Reinhard's global operator on luminance, scaled by the brightest pixel")  # fmt: skip
    more("--scale", type=values.number(), default=1.0, metavar="X", help="multiply radiance first")


def _store_options(command: argparse.ArgumentParser) -> None:
    add_files(command, "EXR that holds all data cameras", "light field file (.mkv)")
    add_geometry(command)
    add(add_encoder(command), "white")


def _tiles_options(command: argparse.ArgumentParser) -> None:
    add_files(command, "light field file (.mkv): array or slab", "EXR with all views side by side")
    add_bits(command)


def _tool(
    text: str, options: Callable[..., None], run: Callable[[argparse.Namespace], None]
) -> tuple[Command, str]:
    return Command(f"{text[0].upper()}{text[1:]}.", "", options, run), text


TOOLS = {
    "convert": _tool("turn an EXR into a picture to look at", _convert_options, convert),
    "store": _tool("store a camera array's EXR as a light field file", _store_options, store),
    "tiles": _tool("write a light field file's views as one tiled EXR", _tiles_options, tiles),
}
"""Tools between tiled EXR, video and pictures; see :data:`lfcore.cli.imgtool.TOOLS`."""
