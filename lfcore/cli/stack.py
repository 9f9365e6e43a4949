"""``lfcore refocus``, and ``lfcore stack``: focal and aperture stacks."""

import argparse
import math
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

import lfcore
from lfcore.cli import planes as plane_options
from lfcore.cli import values
from lfcore.cli.command import (
    Command,
    add,
    add_lightfield,
    add_output,
    check_output,
    flags,
    form,
    open_field,
    refuse,
)
from lfcore.cli.progress import progress, wrote
from lfcore.colour import exposed
from lfcore.optics.planes import SensorPlane
from lfcore.pictures import CODED, SUFFIXES, contact_sheet
from lfcore.refocus.focal_stack import focal_stack

REFOCUS = """\
Make pictures from a light field file: focused at any distance, through any aperture up to the
recorded lens. No scene is needed."""
REFOCUS_EPILOG = """\
examples:
  lfcore refocus bike.mkv -o near.png --focus near
      or middle, far, 40% of the visible depth; or --focus-at 0.5,0.4, a place in the picture
  lfcore refocus bike.mkv -o bike.png --focus 3.2 --f-number 2.8 --aperture polygon:5
  lfcore refocus bike.mkv -o bike.png --plane focus=2,f_number=2 --plane focus=6,f_number=8
      two pictures from one pass, named bike_00_focus2m_f2_circle.png and so on
  lfcore refocus bike.mkv -o bike.exr --plane planes.csv
      with planes.csv:  focus,f_number,aperture
                        2.0,2.8,circle
                        4.0,5.6,square
  lfcore refocus walk.mkv -o walk.mp4 --focus 2:6 --f-number 2
      a film recorded by 'lfcore record --frames', its focus pulled from 2 m to 6 m
  lfcore refocus chess.mkv -o chess.png --focus 1.5px --f-number 7views
      an imported light field with unknown cameras

PNG, PPM, JPEG and WebP hold 8-bit sRGB, PNG 16 bits with --bits 16; EXR and NPY linear light in
float32. Several planes go to one NPY.
"""


def refocus_options(command: argparse.ArgumentParser) -> None:
    add_lightfield(command)
    add_output(command, "picture to write")
    plane_options.add_options(command, of_file=True)
    many = command.add_argument_group("a film, to .mp4")
    many.add_argument(
        "--keys", type=Path, metavar="FILE",
        help="focus and f-number over time: CSV or a YAML list with time in seconds and the keys "
        "of --plane, or with time and view, the point of the lens in shares: 0.5 0",
    )  # fmt: skip
    add_method(command)


def add_method(command: argparse.ArgumentParser, *more: str, help: str = "") -> None:
    """Add the options of the method that makes pictures from a file."""
    method = command.add_argument_group("method")
    methods = ("slicing", "shift-sum", *more)
    method.add_argument("--method", choices=methods, help=f"default: by the filter{help}")
    method.add_argument(
        "--filter", choices=("depth", "nearest", "bilinear"),
        help="depth (default for files with depth), nearest (default for others) or bilinear "
        "(shift-sum only)",
    )  # fmt: skip
    add(
        method,
        "device",
        pixels="pixels of the longer side, or 1920x1080 (as recorded); with slicing at most those "
        "of the views",
    )


def make_pictures(
    arguments: argparse.Namespace, field: lfcore.LightField, planes: list[SensorPlane]
) -> np.ndarray:
    """Make the planes' pictures, (P, height, width, 3), with a line of progress."""
    in_blocks = arguments.method == "blocks"
    if in_blocks and (
        arguments.filter not in (None, "nearest") or arguments.pixels or arguments.salvage
    ):
        refuse("--method", "blocks excludes --filter, --pixels and --salvage", "Leave them out")
    with progress("refocusing", "frames") as report:
        if in_blocks:
            return focal_stack(field, planes, device=arguments.device, progress=report)
        return field.refocus_many(
            planes, method=arguments.method, filter=arguments.filter, pixels=arguments.pixels,
            device=arguments.device, progress=report,
        )  # fmt: skip


def refocus(arguments: argparse.Namespace) -> None:
    if arguments.output.suffix.lower() == ".mp4":
        pull(arguments)
        return
    check_output(arguments)
    if "pull" in (arguments.focus or {}) or arguments.keys:
        refuse("--output", "a pulled focus makes a film", "Write an .mp4")
    field = open_field(arguments)
    planes = plane_options.read_planes(arguments, field)
    if field.metric:
        plane_options.report(planes)
    plane_options.say_doubts(planes, field)
    pictures = make_pictures(arguments, field, plane_options.formed_planes(arguments, planes))
    apart = plane_options.file_disparities(arguments, planes, field, max(pictures.shape[1:3]))
    field.close()  # decoders hold more memory than pictures
    plane_options.save(arguments.output, planes, pictures, form(arguments), field, apart)


def pull(arguments: argparse.Namespace) -> None:
    """Write a film of all instants of a light field."""
    from lfcore.film import write_film

    for option in flags(arguments, "instant", "plane", "dual_pixel", "method"):
        refuse(option, "is for pictures, not for a film", "Leave it out, or write a .png")
    field = open_field(arguments, film=True)
    if len(field.times) < 2:
        refuse("--output", "the file has one instant, which is no film", "Write a .png")
    damaged = [k for k in range(len(field.times)) if field.at(k).damage]
    if damaged:
        refuse("--salvage", f"instants {damaged[0]} to {damaged[-1]} are damaged",
               "Give --instant and a .png")  # fmt: skip
    keys = plane_options.read_keys(arguments, field)
    rate = (len(field.times) - 1) / (field.times[-1] - field.times[0])
    with progress("refocusing", "instants") as report:
        pictures = field.pull(
            keys, filter=arguments.filter, pixels=arguments.pixels, device=arguments.device,
            progress=report,
        )  # fmt: skip
        if sensor := arguments.sensor:
            pictures = (sensor.exposed(picture, k) for k, picture in enumerate(pictures))
        shown = (exposed(picture, **arguments.exposure) for picture in pictures)
        write_film(arguments.output, shown, Fraction(rate).limit_denominator(1001))
    field.close()
    wrote(arguments.output, f": {len(field.times)} pictures")


DESCRIPTION = """\
Make a focal stack (one aperture, several focus distances) or an aperture stack (one focus,
several f-numbers) from one pass over a light field file."""
EPILOG = """\
examples:
  lfcore stack bike.mkv --sheet
      from near to far, in one picture: bike_stack.png
  lfcore stack bike.mkv --focus near:far:60 -o focal.mp4
      a film through the scene, evenly in dioptres
  lfcore stack bike.mkv --focus 2 3 4 6 -o focal.png
      focal_00_focus2m_f2_circle.png and so on
  lfcore stack bike.mkv --f-number 2 2.8 4 5.6 --focus 3 --normalise lens --sheet -o stops.png
      side by side in one picture; they dim as the lens stops down
  lfcore stack chess.mkv --focus -2px:2px:9 --sheet
      from an imported light field whose cameras are not known
"""
SHEET_WIDTH = 4
"""The pictures per row of a contact sheet."""
GAP_PX = 4
"""The gap between pictures on a contact sheet, pixels."""
STEPS = 10
"""The default number of a focal stack's pictures."""
SHEET_STEPS = 8
"""The default number of pictures on a contact sheet."""
Focus = dict[str, Any]
"""One focus distance (``focus_m`` or ``disparity_px``), or a range: ``ends`` and ``steps``."""


def focus(text: str) -> Focus:
    """Read a focus, or a range such as ``near:far:60``."""
    if ":" not in text:
        return values.focus(text)
    parts = text.split(":")
    if len(parts) != 3:
        raise argparse.ArgumentTypeError(f"{text!r} is not a range like 1.5:8:60")
    ends = [values.focus(end) for end in parts[:2]]
    if ends[0].keys() != ends[1].keys():
        raise argparse.ArgumentTypeError(f"{text!r} mixes metres and pixels")
    return {"ends": ends, "steps": values.count(2, plane_options.MOST_PLANES)(parts[2])}


def options(command: argparse.ArgumentParser) -> None:
    add_lightfield(command)
    add_output(command, "picture or .mp4 (the file's name and _stack.png)", required=False)
    stack = command.add_argument_group("the stack")
    stack.add_argument(
        "--focus", nargs="+", type=focus, metavar="FOCUS", default=[],
        help="metres, 'inf', pixels of disparity (1.5px), or a range NEAR:FAR:COUNT, evenly in "
        f"dioptres (near:far:{STEPS}, with --sheet near:far:{SHEET_STEPS})",
    )  # fmt: skip
    stack.add_argument(
        "--f-number", nargs="+", type=values.f_number, metavar="F", default=[],
        help="f-numbers, or widths in views: 7views (the whole lens)",
    )  # fmt: skip
    add(stack, "aperture", "lens", "normalise")
    form = command.add_argument_group("form")
    form.add_argument("--sheet", action="store_true", help="all pictures in one")
    form.add_argument(
        "--fps", type=values.count(1, 240), default=12, help="pictures per second of a film (12)"
    )
    add(form, "bits", "exposure", "sensor")
    add_method(command, "blocks", help="; blocks is fast for many pictures, with a little blur")


def run(arguments: argparse.Namespace) -> None:
    path = arguments.output or Path(f"{Path(arguments.lightfield).stem}_stack.png")
    arguments.output, film = path, path.suffix.lower() == ".mp4"
    if not film:
        check_output(arguments, (*(CODED if arguments.sheet else SUFFIXES), ".mp4"))
    if film and arguments.sheet:
        refuse("--sheet", "a contact sheet is no film", "Write a .png")
    field = open_field(arguments)
    planes = stack_planes(arguments, field)
    plane_options.say_doubts(planes, field)
    pictures = make_pictures(arguments, field, planes)
    if arguments.sensor and (film or arguments.sheet):
        pictures = arguments.sensor.exposed(pictures)
    if film:
        from lfcore.film import write_film

        write_film(path, exposed(pictures, **arguments.exposure), arguments.fps)
    elif arguments.sheet:
        labels = plane_options.labels(planes, field)
        shown = exposed(pictures, **arguments.exposure).clip(0, 1)
        lfcore.write_picture(
            path, contact_sheet(shown, SHEET_WIDTH, GAP_PX, labels), bits=arguments.bits
        )
    else:
        plane_options.save(path, planes, pictures, form(arguments), field)
        return
    wrote(path, f": {len(planes)} pictures")


def stack_planes(arguments: argparse.Namespace, field: lfcore.LightField) -> list[SensorPlane]:
    """The planes of every focus distance with every f-number."""
    lens = arguments.f_number or [{}]
    steps = SHEET_STEPS if arguments.sheet else STEPS
    # By default through the whole scene, or as recorded for an aperture stack.
    ranges = arguments.focus or ([{}] if arguments.f_number else [focus(f"near:far:{steps}")])
    distances = [distance for each in ranges for distance in _evenly(each, field)]
    plane_options.check_count(len(lens) * len(distances))
    same = plane_options.settings(arguments, "aperture", "lens", "normalise")
    return [
        plane_options.make_plane(field, {**same, "focus": distance, "f_number": aperture})
        for distance in distances for aperture in lens
    ]  # fmt: skip


def _evenly(focus: Focus, field: lfcore.LightField) -> list[Focus]:
    """The distances of a range, evenly spaced in dioptres; a single distance as it is."""
    if "ends" not in focus:
        return [focus]
    ends, steps = focus["ends"], focus["steps"]
    if "disparity_px" in ends[0]:  # pixels are linear in dioptres
        first, last = (end["disparity_px"] for end in ends)
        return [{"disparity_px": px} for px in np.linspace(first, last, steps).tolist()]
    first, last = (1 / plane_options.make_plane(field, {"focus": end}).focus_m for end in ends)
    dioptres = np.linspace(first, last, steps)
    return [{"focus_m": 1 / each if each else math.inf} for each in dioptres.tolist()]


COMMANDS = {
    "refocus": Command(REFOCUS, REFOCUS_EPILOG, refocus_options, refocus),
    "stack": Command(DESCRIPTION, EPILOG, options, run),
}
