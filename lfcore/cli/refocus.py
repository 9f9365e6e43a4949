"""``lfcore refocus``."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from lfcore.cli import planes as plane_options
from lfcore.cli.command import add_command
from lfcore.cli.progress import progress, say
from lfcore.pictures import check_bits, check_suffix, write_pictures

DESCRIPTION = """\
Make pictures from a light field file: focused at any distance, through any aperture that is no
wider than the lens it was recorded with. The file alone is enough."""
EPILOG = """\
examples:
  lfcore refocus bike.mkv -o bike.png
      as recorded
  lfcore refocus bike.mkv --focus 3.2 --f-number 2.8 --aperture polygon --blades 5 -o bike.png
  lfcore refocus bike.mkv --plane focus=2,f=2 --plane focus=6,f=8 -o bike.png
      two pictures from one pass, named bike_00_focus2m_f2_circle.png and so on
  lfcore refocus bike.mkv --planes planes.csv -o bike.exr
      with planes.csv:  focus,f,aperture
                        2.0,2.8,circle
                        4.0,5.6,square
  lfcore refocus bike.mkv --focus 3.2 --filter bilinear -o bike.npy
      smoother, by shift-sum; linear light, float32
  lfcore refocus chess.mkv --disparity 1.5 --aperture-views 7 -o chess.png
      an imported light field whose cameras are not known

PNG, PPM, JPEG and WebP hold 8-bit sRGB, PNG 16 bits with --bits 16; EXR and NPY linear light in
float32. Several planes go to one NPY.
"""


def add_parser(commands, name: str, summary: str) -> None:
    command = add_command(commands, name, summary, DESCRIPTION, EPILOG)
    command.add_argument("lightfield", help="light field file, .mkv, or its URL")
    command.add_argument("-o", "--output", type=Path, required=True, help="picture to write")
    plane_options.add_options(command)
    plane_options.add_by_views(command.add_argument_group("without metres"))
    add_method(command)
    command.set_defaults(run=run)


def add_method(command: argparse.ArgumentParser) -> None:
    """Options on how pictures are made from a file."""
    how = command.add_argument_group("method")
    how.add_argument("--method", choices=("slicing", "shift-sum"), help="default: by the filter")
    how.add_argument(
        "--filter", choices=("nearest", "bilinear"), default="nearest",
        help="nearest (slicing or shift-sum) or bilinear (shift-sum)",
    )  # fmt: skip
    how.add_argument("--device", help="part of an OpenCL device's name; see 'lfcore devices'")
    how.add_argument(
        "--salvage", action="store_true", help="leave out damaged segments instead of refusing"
    )


def open_field(arguments: argparse.Namespace):
    """The light field of the command line; damage that is left out is told."""
    from lfcore.lightfield import LightField

    field = LightField.open(arguments.lightfield, salvage=arguments.salvage)
    for damage in field.damage:
        say(f"left out: {damage.reason}")
    return field


def make_pictures(arguments: argparse.Namespace, field, planes) -> np.ndarray:
    """(P, M, M, 3) of the planes, with a line of progress."""
    with progress(f"refocusing {len(planes)} planes", "frames") as report:
        return field.refocus_many(
            planes,
            method=arguments.method,
            filter=arguments.filter,
            device=arguments.device,
            progress=report,
        )


def run(arguments: argparse.Namespace) -> None:
    check_suffix(arguments.output)
    check_bits(arguments.output, arguments.bits)
    field = open_field(arguments)
    plane_options.settle(arguments, field)
    planes = plane_options.read_planes(arguments, field.require_slab().camera, field)
    plane_options.check_planes(planes, field.slab, arguments.lightfield)
    pictures = make_pictures(arguments, field, planes)
    save(arguments.output, planes, pictures, field, arguments.bits)


def save(path: Path, planes, pictures: np.ndarray, field=None, bits: int = 8) -> None:
    """Write what was made and say where; several planes go to one NPY, or a file each."""
    if path.suffix.lower() == ".npy":
        named = [(path, pictures[0] if len(planes) == 1 else pictures)]
    else:
        named = list(zip(plane_options.output_names(path, planes, field), pictures, strict=True))
    write_pictures(named, bits=bits)
    for file, _ in named:
        say(f"wrote {file}")
