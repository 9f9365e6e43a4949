"""``lfcore stack``: focal and aperture stacks."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import numpy as np

import lfcore
from lfcore.cli import planes as plane_options
from lfcore.cli.command import Command, exclude, open_field, refuse
from lfcore.cli.options import add_lightfield, distance
from lfcore.cli.progress import progress, wrote
from lfcore.cli.refocus import add_method, make_pictures
from lfcore.errors import OpticsError
from lfcore.optics.planes import SensorPlane
from lfcore.pictures import CODED, SUFFIXES, check_bits, check_suffix, contact_sheet

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
SHEET_WIDTH, GAP_PX = 4, 4


def options(command: argparse.ArgumentParser) -> None:
    add_lightfield(command)
    command.add_argument(
        "-o", "--output", type=Path,
        help="picture or .mp4 (default: the file's name and _stack.png)",
    )  # fmt: skip
    what = command.add_argument_group("the stack")
    what.add_argument("--focus", nargs="+", type=distance, metavar="M",
                      help="focus distances, metres, or 'inf'")  # fmt: skip
    what.add_argument("--focus-from", type=distance, metavar="M")
    what.add_argument("--focus-to", type=distance, metavar="M")
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


def run(arguments: argparse.Namespace) -> None:
    path = arguments.output or Path(f"{Path(arguments.lightfield).stem}_stack.png")
    film = path.suffix.lower() == ".mp4"
    check_suffix(path, (*CODED, ".mp4") if arguments.sheet else (*SUFFIXES, ".mp4"))
    if not film:
        check_bits(path, arguments.bits)
    if film and arguments.sheet:
        refuse("--sheet", "a contact sheet is no film", "Write a .png")
    if not 1 <= arguments.fps <= 240:
        refuse("--fps", f"must be from 1 to 240, not {arguments.fps}")
    field = open_field(arguments)
    planes = stack_planes(arguments, field)
    make = _make_fast if arguments.fast else make_pictures
    pictures = make(arguments, field, planes)
    if film:
        from lfcore.film import write_film

        write_film(path, pictures, arguments.fps)
    elif arguments.sheet:
        sheet = contact_sheet(pictures, min(SHEET_WIDTH, len(pictures)), GAP_PX)
        lfcore.write_picture(path, sheet, bits=arguments.bits)
    else:
        plane_options.save(path, planes, pictures, arguments.bits, field)
        return
    wrote(path, f": {len(planes)} pictures")


def _make_fast(
    arguments: argparse.Namespace, field: lfcore.LightField, planes: list[SensorPlane]
) -> np.ndarray:
    from lfcore.refocus.focal_stack import focal_stack

    filtered = arguments.filter not in (None, "nearest") or arguments.size
    if arguments.method or filtered or arguments.salvage:
        exclude("--fast", "--method, --filter, --size and --salvage")
    with progress(f"refocusing {len(planes)} planes", "frames") as report:
        return focal_stack(field, planes, device=arguments.device, progress=report)


def stack_planes(arguments: argparse.Namespace, field: lfcore.LightField) -> list[SensorPlane]:
    """Every focus distance at every f-number.

    Raises :class:`OpticsError` for options that contradict each other or too many planes, and
    where the range of depths is needed and not known.
    """
    lens, focus = apertures(arguments), focus_settings(arguments, field)
    if len(lens) * len(focus) > plane_options.MOST_PLANES:
        raise OpticsError(
            f"{len(lens) * len(focus)} pictures were asked for",
            remedy=f"Ask for {plane_options.MOST_PLANES} at a time",
        )
    same = plane_options.settings(arguments, plane_options.APERTURE)
    return [plane_options.make_plane(field, same | one | other) for one in focus for other in lens]


def apertures(arguments: argparse.Namespace) -> list[dict[str, float]]:
    """Those given, as f-numbers or views across; the whole lens where none are."""
    if arguments.f_numbers and arguments.aperture_views:
        exclude("--aperture-views", "--f-numbers")
    if arguments.f_numbers:
        return [{"f_number": number} for number in arguments.f_numbers]
    return [{"aperture_views": across} for across in arguments.aperture_views or ()] or [{}]


def focus_settings(
    arguments: argparse.Namespace, field: lfcore.LightField
) -> list[dict[str, float]]:
    """Those given, or evenly in dioptres from one end to the other, or through the whole scene.

    As recorded for a stack of apertures alone.
    """
    metres = _ends("focus", arguments.focus_from, arguments.focus_to)
    moved = _ends("disparity", arguments.disparity_from, arguments.disparity_to)
    if sum(bool(way) for way in (arguments.focus, metres, moved)) > 1:
        refuse("--focus", "there is one way to say where to focus", "Give distances, or ends")
    if arguments.focus:
        if arguments.count is not None:
            refuse("--count", "belongs to --focus-from and --focus-to")
        return [{"focus_m": metres} for metres in arguments.focus]
    steps = arguments.count
    if steps is None:
        if (arguments.f_numbers or arguments.aperture_views) and not (metres or moved):
            return [{}]
        steps = 8 if arguments.sheet else 10
    if steps < 2:
        refuse("--count", f"must be at least 2, not {steps}")
    if moved:  # evenly in pixels is evenly in dioptres
        return [{"disparity_px": pixels} for pixels in np.linspace(*moved, steps).tolist()]
    near, far = metres or whole_scene(field)
    if not (near > 0 and far > 0):
        refuse("--focus-from", "focus distances are positive")
    dioptres = np.linspace(1 / near, 1 / far, steps).tolist()
    return [{"focus_m": 1 / delta if delta else math.inf} for delta in dioptres]


def _ends(what: str, first: float | None, last: float | None) -> tuple[float, float] | None:
    if first is not None and last is not None:
        return first, last
    if (first, last) != (None, None):
        refuse(f"--{what}-from", f"goes with --{what}-to", "Give both")
    return None


def whole_scene(field: lfcore.LightField) -> tuple[float, float]:
    """The nearest and farthest distance at which there is something to see and the lens focuses.

    Raises :class:`OpticsError` where the file does not say.
    """
    if field.depth_range is None:
        what = "focus" if field.metric else "disparity"
        raise OpticsError(
            "does not say how near and far its scene is", file=field.path,
            remedy=f"Give --{what}-from and --{what}-to",
        )  # fmt: skip
    near, far = field.depth_range
    closest = 1.01 * field.require_slab().camera.focal_length_m
    return max(near, closest), max(far, closest)


COMMANDS = {"stack": Command(DESCRIPTION, EPILOG, options, run, programs=True)}
