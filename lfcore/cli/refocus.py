"""``lfcore refocus``."""

import argparse

import numpy as np

import lfcore
from lfcore.cli import planes as plane_options
from lfcore.cli.command import Command, open_field
from lfcore.cli.options import add, add_lightfield, add_output, check_form, form
from lfcore.cli.progress import progress
from lfcore.optics.planes import SensorPlane
from lfcore.pictures import check_suffix

DESCRIPTION = """\
Make pictures from a light field file: focused at any distance, through any aperture that is no
wider than the lens it was recorded with. The file alone is enough."""
EPILOG = """\
examples:
  lfcore refocus bike.mkv -o near.png --focus near
      or middle, far, 40% of the depth that is seen; or --focus-at 0.5,0.4, a place in the picture
  lfcore refocus bike.mkv -o bike.png --focus 3.2 --f-number 2.8 --aperture polygon:5
  lfcore refocus bike.mkv -o bike.png --plane focus=2,f_number=2 --plane focus=6,f_number=8
      two pictures from one pass, named bike_00_focus2m_f2_circle.png and so on
  lfcore refocus bike.mkv -o bike.exr --plane planes.csv
      with planes.csv:  focus,f_number,aperture
                        2.0,2.8,circle
                        4.0,5.6,square
  lfcore refocus chess.mkv -o chess.png --focus 1.5px --f-number 7views
      an imported light field whose cameras are not known

PNG, PPM, JPEG and WebP hold 8-bit sRGB, PNG 16 bits with --bits 16; EXR and NPY linear light in
float32. Several planes go to one NPY.
"""


def options(command: argparse.ArgumentParser) -> None:
    add_lightfield(command)
    add_output(command, "picture to write")
    plane_options.add_options(command, of_file=True)
    add_method(command)


def add_method(command: argparse.ArgumentParser, *more: str, help: str = "") -> None:
    """Options of how pictures are made from a file."""
    how = command.add_argument_group("method")
    methods = ("slicing", "shift-sum", *more)
    how.add_argument("--method", choices=methods, help=f"default: by the filter{help}")
    how.add_argument(
        "--filter", choices=("depth", "nearest", "bilinear"),
        help="depth (default for files with depth), nearest (default for others) or bilinear "
        "(shift-sum only)",
    )  # fmt: skip
    add(
        how,
        "device",
        pixels="pixels of the longer side, or 1920x1080 (as recorded); by slicing no more than its "
        "views have",
    )


def make_pictures(
    arguments: argparse.Namespace, field: lfcore.LightField, planes: list[SensorPlane]
) -> np.ndarray:
    """(P, height, width, 3) of the planes, with a line of progress."""
    with progress("refocusing", "frames") as report:
        return field.refocus_many(
            planes, method=arguments.method, filter=arguments.filter, pixels=arguments.pixels,
            device=arguments.device, progress=report,
        )  # fmt: skip


def run(arguments: argparse.Namespace) -> None:
    check_suffix(arguments.output)
    check_form(arguments, arguments.output)
    field = open_field(arguments)
    planes = plane_options.read_planes(arguments, field)
    if field.metric:
        plane_options.report(planes)
    plane_options.say_doubts(planes, field)
    pictures = make_pictures(arguments, field, planes)
    field.close()  # decoders hold more memory than pictures
    plane_options.save(arguments.output, planes, pictures, form(arguments), field)


COMMANDS = {"refocus": Command(DESCRIPTION, EPILOG, options, run)}
