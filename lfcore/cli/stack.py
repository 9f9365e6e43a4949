"""``lfcore stack``: focal and aperture stacks."""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from lfcore.cli import planes as plane_options
from lfcore.cli.command import add_command
from lfcore.cli.progress import progress, say
from lfcore.cli.refocus import add_method, make_pictures, open_field, save
from lfcore.errors import LfcoreError, OpticsError
from lfcore.pictures import CODED, SUFFIXES, check_bits, check_suffix, write_picture

DESCRIPTION = """\
Make a focal stack (one aperture, several focus distances) or an aperture stack (one focus,
several f-numbers) from a light field file, all from one pass over it. Without distances a focal
stack goes from the nearest to the farthest depth that the file knows of, evenly in dioptres."""
EPILOG = """\
examples:
  lfcore stack bike.mkv --sheet
      from near to far, in one picture: bike_stack.png
  lfcore stack bike.mkv --focus 2 3 4 6 -o focal.png
      focal_00_focus2m_f2_circle.png and so on
  lfcore stack bike.mkv --focus-from 1.5 --focus-to 8 --count 60 -o focal.mp4
      a film through the scene, evenly in dioptres
  lfcore stack bike.mkv --f-numbers 2 2.8 4 5.6 --focus 3 --no-normalise --sheet -o stops.png
      one picture with all of them side by side, which dim as the lens stops down

  lfcore stack chess.mkv --disparity-from -2 --disparity-to 2 --count 9 --sheet
      of an imported light field whose cameras are not known

A name that ends in .mp4 gives a film, --sheet a contact sheet, else each picture has a file.
"""
SHEET_WIDTH = 4
GAP_PX = 4


def add_parser(commands, name: str, summary: str) -> None:
    command = add_command(commands, name, summary, DESCRIPTION, EPILOG)
    command.add_argument("lightfield", type=Path, help="light field file, .mkv")
    command.add_argument(
        "-o",
        "--output",
        type=Path,
        help="picture or .mp4 (default: the file's name and _stack.png)",
    )
    what = command.add_argument_group("the stack")
    what.add_argument("--focus", nargs="+", type=plane_options.distance, metavar="M",
                      help="focus distances, metres, or 'inf'")  # fmt: skip
    what.add_argument("--focus-from", type=plane_options.distance, metavar="M")
    what.add_argument("--focus-to", type=plane_options.distance, metavar="M")
    what.add_argument("--disparity-from", type=float, metavar="PX", help="pixels from view to view")
    what.add_argument("--disparity-to", type=float, metavar="PX")
    what.add_argument("--count", type=int, metavar="K",
                      help="pictures from one to the other (10, of a sheet 8)")  # fmt: skip
    what.add_argument("--f-numbers", nargs="+", type=float, metavar="F",
                      help="default: the whole lens")  # fmt: skip
    what.add_argument("--aperture-views", nargs="+", type=float, metavar="N",
                      help="instead of f-numbers: views across")  # fmt: skip
    plane_options.add_aperture(what)
    form = command.add_argument_group("form")
    form.add_argument("--sheet", action="store_true", help="all pictures in one")
    form.add_argument("--fps", type=int, default=12, help="pictures a second of a film (12)")
    plane_options.add_bits(form)
    add_method(command)
    form.add_argument("--fast", action="store_true",
                      help="a focal stack by adding views in blocks first: a little blur, and "
                      "many pictures for the price of a few")  # fmt: skip
    command.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    source = arguments.lightfield
    path = arguments.output or Path(f"{source.stem}_stack.png")
    film = path.suffix.lower() == ".mp4"
    check_suffix(path, (*CODED, ".mp4") if arguments.sheet else (*SUFFIXES, ".mp4"))
    if not film:
        check_bits(path, arguments.bits)
    if film and arguments.sheet:
        raise LfcoreError("a contact sheet is no film", key="--sheet", remedy="Write a .png")
    if not 1 <= arguments.fps <= 240:
        raise LfcoreError(f"must be from 1 to 240, not {arguments.fps}", key="--fps")
    field = open_field(arguments)
    planes = stack_planes(arguments, field)
    plane_options.check_planes(planes, field.slab, arguments.lightfield)
    make = _make_fast if arguments.fast else make_pictures
    pictures = make(arguments, field, planes)
    if film:
        from lfcore.film import write_film

        write_film(path, pictures, arguments.fps)
    elif arguments.sheet:
        write_picture(path, contact_sheet(pictures), bits=arguments.bits)
    else:
        save(path, planes, pictures, field, arguments.bits)
        return
    say(f"wrote {path}: {len(planes)} pictures")


def _make_fast(arguments: argparse.Namespace, field, planes) -> np.ndarray:
    from lfcore.refocus.focal_stack import focal_stack

    if arguments.method or arguments.filter != "nearest" or arguments.salvage:
        raise OpticsError(
            "excludes --method, --filter and --salvage", key="--fast", remedy="Leave one out"
        )
    with progress(f"refocusing {len(planes)} planes", "frames") as report:
        return focal_stack(field.path, planes, device=arguments.device, progress=report)


def stack_planes(arguments: argparse.Namespace, field):
    """Every focus distance at every f-number.

    Raises :class:`OpticsError` for options that contradict each other or too many planes, and
    where the range of depths is needed and not known.
    """
    from lfcore.optics.planes import SensorPlane

    camera = field.require_slab().camera
    lens = f_numbers(arguments, field) or [camera.f_number]
    distances = focus_distances(arguments, field) or [camera.focus_distance_m]
    if len(lens) * len(distances) > plane_options.MOST_PLANES:
        raise OpticsError(
            f"{len(lens) * len(distances)} pictures were asked for",
            remedy=f"Ask for {plane_options.MOST_PLANES} at a time",
        )
    if arguments.keep_magnification:
        field.require_metric("--keep-magnification")
    first = SensorPlane(
        distances[0], lens[0], arguments.aperture, arguments.blades, arguments.rotation,
        "aperture" if arguments.normalise else "lens", arguments.keep_magnification,
    )  # fmt: skip
    return [
        replace(first, focus_distance_m=distance, f_number=number)
        for distance in distances
        for number in lens
    ]


def f_numbers(arguments: argparse.Namespace, field) -> list[float]:
    """Those given, or those of apertures so many views across."""
    if arguments.f_numbers:
        field.require_metric("--f-numbers")
        if arguments.aperture_views:
            raise OpticsError("excludes --f-numbers", key="--aperture-views",
                              remedy="Leave one out")  # fmt: skip
        return arguments.f_numbers
    return [field.f_number_of(across) for across in arguments.aperture_views or ()]


def focus_distances(arguments: argparse.Namespace, field) -> list[float]:
    """Those given, or evenly in dioptres from one end to the other, or through the whole scene.

    None for a stack of apertures alone, which is focused as recorded.
    """
    metres = (arguments.focus_from, arguments.focus_to)
    moved = (arguments.disparity_from, arguments.disparity_to)
    if arguments.focus or metres != (None, None):
        field.require_metric("--focus")
    if arguments.focus and arguments.count is not None and metres == moved == (None, None):
        raise OpticsError("belongs to --focus-from and --focus-to", key="--count")
    if moved != (None, None):
        if None in moved or arguments.focus or metres != (None, None):
            raise OpticsError(
                "--disparity-from and --disparity-to belong together, without --focus",
                remedy="Give both",
            )
        ends = tuple(field.distance_of(pixels) for pixels in moved)
    elif metres != (None, None):
        if None in metres or arguments.focus:
            raise OpticsError(
                "--focus-from and --focus-to belong together, without --focus",
                remedy="Give both, or a list with --focus",
            )
        ends = metres
    elif arguments.focus:
        return arguments.focus
    elif (arguments.f_numbers or arguments.aperture_views) and arguments.count is None:
        return []
    else:
        ends = whole_scene(field)
    return evenly(ends, arguments.count or (8 if arguments.sheet else 10), arguments.count)


def evenly(ends: tuple, count: int, asked: int | None) -> list[float]:
    """``count`` distances between two, evenly in dioptres."""
    if count < 2 or asked == 0:
        raise OpticsError(f"must be at least 2, not {asked}", key="--count")
    if not all(end > 0 for end in ends):
        raise OpticsError("focus distances are positive", key="--focus-from")
    dioptres = np.linspace(1 / ends[0], 1 / ends[1], count).tolist()
    return [1 / delta if delta else math.inf for delta in dioptres]


def whole_scene(field) -> tuple[float, float]:
    """The nearest and farthest distance at which there is something to see and the lens focuses.

    Raises :class:`OpticsError` where the file does not say.
    """
    if field.depth_range is None:
        ends = "--focus-from and --focus-to" if field.metric else (
            "--disparity-from and --disparity-to")  # fmt: skip
        raise OpticsError(
            "does not say how near and far its scene is", file=field.path, remedy=f"Give {ends}"
        )
    near, far = field.depth_range
    closest = 1.01 * field.require_slab().camera.focal_length_m
    return max(near, closest), max(far, closest)


def contact_sheet(pictures: np.ndarray) -> np.ndarray:
    """(H, W, 3) of pictures (P, height, width, 3): up to four side by side, with white gaps."""
    count, height, width = pictures.shape[:3]
    columns = min(SHEET_WIDTH, count)
    rows = -(-count // columns)
    down, across = height + GAP_PX, width + GAP_PX
    sheet = np.ones((rows * down - GAP_PX, columns * across - GAP_PX, 3), np.float32)
    for k, picture in enumerate(pictures):
        row, column = divmod(k, columns)
        y, x = row * down, column * across
        sheet[y : y + height, x : x + width] = picture
    return sheet
