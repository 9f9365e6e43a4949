"""``lfcore imgtool store`` and ``tiles``: camera arrays between tiled EXR and the video store."""

from __future__ import annotations

import argparse
import hashlib
from pathlib import Path

import numpy as np

from lfcore.cli.progress import progress
from lfcore.optics.array import CameraArray
from lfcore.pictures import check_suffix
from lfcore.storage.codecs import CODECS
from lfcore.storage.defaults import codec_spec

VIDEO = ".mkv"


def add_encoder(command: argparse.ArgumentParser):
    """Options of the video that a light field is stored in; returns their group."""
    how = command.add_argument_group("storage")
    how.add_argument(
        "--codec", choices=tuple(CODECS), default="libx264", help="ffv1 loses nothing more"
    )
    how.add_argument("--crf", type=float, help="lower is better and larger (default: by N)")
    how.add_argument("--preset", help="of the encoder (default: by N)")
    how.add_argument(
        "--white", type=float, metavar="L",
        help="of an array: radiance of the brightest code (default: the brightest, at least 1)",
    )  # fmt: skip
    return how


def asked(arguments: argparse.Namespace) -> dict:
    """What the options of :func:`add_encoder`, and ``--pixel-format``, ask of an encoder."""
    given = {key: getattr(arguments, key, None) for key in ("pixel_format", "crf", "preset")}
    return {"codec": arguments.codec} | {k: v for k, v in given.items() if v is not None}


def add_tiles(command: argparse.ArgumentParser) -> None:
    command.add_argument("--half", action="store_true", help="write 16-bit floats")
    command.add_argument("input", type=Path, help="light field file, .mkv: array or slab")
    command.add_argument("output", type=Path, help="EXR to write, all views side by side")


def read_lightfield(path: Path) -> tuple[np.ndarray, CameraArray | None, dict]:
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


def save_video(arguments, image: np.ndarray, array: CameraArray, scene: dict) -> str:
    """Store an array as the options of :func:`add_encoder` say; returns one line about it."""
    from lfcore.refocus.array.stored import store_array

    output = arguments.output
    check_suffix(output, (VIDEO,))
    spec = codec_spec(array.cameras[0], **asked(arguments))
    with progress("encoding", "cameras") as report:
        made = store_array(
            output, image, array, spec, scene=scene, white=arguments.white, progress=report
        )
    white = made.array["white"]
    clipped = float((image > white).any(-1).mean())
    said = f"{output}: {array.cameras[0]} x {array.cameras[1]} cameras, "
    said += f"{output.stat().st_size:,} bytes, white at {white:g}"
    return said + (f", {100 * clipped:.2g} % of the pixels clipped" if clipped else "")


def store(arguments: argparse.Namespace, geometry) -> str:
    """EXR to video.  ``geometry(arguments, recorded, shape)`` gives the array, or raises."""
    check_suffix(arguments.input, (".exr",), "input")
    image, recorded, extra = read_lightfield(arguments.input)
    array = geometry(arguments, recorded, image.shape)
    with arguments.input.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    name = str(extra.get("scene", arguments.input.stem))
    return save_video(arguments, image, array, {"name": name, "digest": digest})


def tiles(arguments: argparse.Namespace) -> str:
    """Video to EXR, with the geometry in its header."""
    from lfcore.storage.tiled_exr import write_array

    check_suffix(arguments.input, (VIDEO,), "input")
    check_suffix(arguments.output, (".exr",), "output")
    image, array, extra = read_lightfield(arguments.input)
    write_array(arguments.output, image, array, half=arguments.half, extra=extra)
    return f"{arguments.output}: {array.cameras[0]} x {array.cameras[1]} tiles of {array.tile}"
