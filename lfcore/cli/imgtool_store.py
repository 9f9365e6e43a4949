"""``lfcore imgtool store``, ``tiles``, ``convert``: camera arrays between tiled EXR and video."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.cli.command import given
from lfcore.cli.film import save_video
from lfcore.cli.progress import progress
from lfcore.colour import tonemap
from lfcore.errors import OpticsError
from lfcore.files import file_digest
from lfcore.optics.array import CameraArray
from lfcore.pictures import ALL_CODED, check_suffix, write_picture

VIDEO = ".mkv"


def add_geometry(command: argparse.ArgumentParser) -> None:
    array = command.add_argument_group("the light field (from the header where it has one)")
    add = array.add_argument
    add("--camsperdim", nargs=2, type=int, metavar=("X", "Y"), help="data cameras (1 1)")
    add(
        "--griddim", nargs=4, type=float, metavar=("XMIN", "XMAX", "YMIN", "YMAX"),
        help="bounding box of the data cameras, metres (0 0 0 0)",
    )  # fmt: skip
    add("--inputfov", type=float, help="field of view of data cameras (90)")
    add(
        "--spacing", choices=("ends", "cells"),
        help="outermost cameras on the bounds, or all in the middle of cells (ends)",
    )  # fmt: skip


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
    if min(cameras) < 1 or width % cameras[0] or height % cameras[1]:
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
    bounds = low_x, high_x, -high_y, -low_y
    spacing = flags.get("spacing") or ("cells" if any(recorded.margin_m) else "ends")
    same = CameraArray.on_grid(recorded.cameras, bounds, recorded.fov_deg, recorded.tile, spacing)
    facts: dict[str, tuple[float, ...]] = {
        "camsperdim": recorded.cameras, "griddim": bounds, "inputfov": (recorded.fov_deg,)
    }  # fmt: skip
    for name, value in flags.items():
        if name == "spacing":
            agrees = np.allclose(same.columns_m, recorded.columns_m)
            agrees, said = agrees and np.allclose(same.rows_m, recorded.rows_m), "other positions"
        else:
            agrees = np.allclose(value, facts[name], rtol=1e-5, atol=1e-9)
            said = " ".join(f"{number:g}" for number in facts[name])
        if not agrees:
            raise OpticsError(
                f"contradicts the header, which says {said}", file=file, key=f"--{name}",
                remedy="Leave the flag out",
            )  # fmt: skip


def read_lightfield(path: Path) -> tuple[np.ndarray, CameraArray | None, dict[str, Any]]:
    """Picture, geometry if there is any, and what else is said of it, from EXR or video."""
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


def store(arguments: argparse.Namespace) -> str:
    """EXR to video."""
    check_suffix(arguments.input, (".exr",), "input")
    image, recorded, extra = read_lightfield(arguments.input)
    array = geometry(arguments, recorded, image.shape)
    name = str(extra.get("scene", arguments.input.stem))
    scene = {"name": name, "digest": file_digest(arguments.input)}
    return f"{arguments.output}{save_video(arguments, image, array, scene)}"


def tiles(arguments: argparse.Namespace) -> str:
    """Video to EXR, with the geometry in its header."""
    from lfcore.storage.tiled_exr import write_array

    check_suffix(arguments.input, (VIDEO,), "input")
    check_suffix(arguments.output, (".exr",), "output")
    image, array, extra = read_lightfield(arguments.input)
    assert array is not None  # a video's is never missing
    write_array(arguments.output, image, array, half=arguments.half, extra=extra)
    return f"{arguments.output}: {array.cameras[0]} x {array.cameras[1]} tiles of {array.tile}"


def convert(arguments: argparse.Namespace) -> str:
    """Write a linear EXR as an 8-bit sRGB picture; returns one line about it.

    Raises :class:`LfcoreError` when either file is at fault.
    """
    from lfcore.exr import read_exr_picture

    check_suffix(arguments.output, ALL_CODED, "output")
    image = np.nan_to_num(read_exr_picture(arguments.input).astype(np.float64)) * arguments.scale
    write_picture(arguments.output, tonemap(image) if arguments.tonemap else image)
    return f"{arguments.output}: {image.shape[1]} x {image.shape[0]}"
