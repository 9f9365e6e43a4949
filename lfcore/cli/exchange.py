"""``lfcore import`` and ``lfcore export``: light fields of others in, ours out."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

from lfcore.cli import planes as plane_options
from lfcore.cli.command import add_command
from lfcore.cli.progress import progress, say
from lfcore.errors import LfcoreError
from lfcore.exchange.table import FORMATS
from lfcore.pictures import check_suffix
from lfcore.scene.emitters import POINTS
from lfcore.storage.codecs import CODECS
from lfcore.storage.pixels import PIXEL_FORMATS

IMPORT = """\
Make a light field file of a light field of another program. The format is recognised by names and
headers where it can be. What it does not hold of its geometry is asked for by --baseline,
--field-of-view and --focus; where that is not known the file can be refocused by disparity, and
what needs metres is refused."""
IMPORT_EPILOG = """\
examples:
  lfcore import boxes/ -o boxes.mkv                       a scene of the HCI benchmark
  lfcore import rectified/ -o chess.mkv                   the Stanford archive's names
  lfcore import shots/ -o shots.mkv --grid 8x5 --order columns-up
  lfcore import IMG_0001.eslf.png -o lytro.mkv --grid 14x14
  lfcore import views/ -o exact.mkv --codec ffv1          8-bit RGB to the last bit
  lfcore import views/ -o lf.mkv --baseline 6mm --field-of-view 40 --focus 1.2

formats:
"""
EXPORT = """\
Write a light field file in the format of another program, into a folder that appears whole or not
at all. --views, --baseline and --crop take a part of it."""
EXPORT_EPILOG = """\
examples:
  lfcore export bike.mkv --format hci --scene scenes/bike -o bike_hci
      with depth, disparity and materials of every view, traced again
  lfcore export bike.mkv --format hci --views 9x9 --baseline 6mm -o bike_hci
  lfcore export bike.mkv --format nerfstudio -o bike_nerf
  lfcore export bike.mkv --format quilt --tiles 8x6 -o quilt

formats:
"""


def add_parser(commands, name: str, summary: str) -> None:
    if name == "import":
        command = add_command(commands, name, summary, IMPORT, IMPORT_EPILOG + _formats("imports"))
        _import_options(command)
        command.set_defaults(run=run_import)
        return
    command = add_command(commands, name, summary, EXPORT, EXPORT_EPILOG + _formats("exports"))
    _export_options(command)
    command.set_defaults(run=run_export)


def _formats(can: str) -> str:
    rows = [row for row in FORMATS.values() if getattr(row, can)]
    return "\n".join(f"  {row.name:<12} {row.title}" for row in rows)


def _import_options(command: argparse.ArgumentParser) -> None:
    command.add_argument("source", type=Path, help="folder or file")
    command.add_argument("-o", "--output", type=Path, required=True, help="file to write, .mkv")
    command.add_argument("--format", metavar="NAME", help="default: recognised")
    what = command.add_argument_group("what the format does not say")
    what.add_argument("--grid", type=pair, metavar="CxR", help="columns and rows of views")
    what.add_argument("--order", metavar="ORDER",
                      help="rows or columns, then -left, -up, -snake: rows-up")  # fmt: skip
    what.add_argument("--variable", help="of a .mat or .h5 file (LF)")
    what.add_argument("--baseline", type=length, metavar="L", help="between views: 6mm, 0.006m")
    what.add_argument("--field-of-view", type=float, metavar="DEG", help="of a view's width")
    what.add_argument("--focus", type=plane_options.distance, metavar="M",
                      help="where the views coincide, metres; 'inf' for parallel ones")  # fmt: skip
    how = command.add_argument_group("storage")
    how.add_argument("--codec", choices=tuple(CODECS), default="libx264",
                     help="ffv1 keeps 8-bit RGB exactly")  # fmt: skip
    how.add_argument("--crf", type=float, help="lower is better and larger (default: by N)")
    how.add_argument("--preset", help="of the encoder (default: by N)")
    how.add_argument("--pixel-format", choices=tuple(PIXEL_FORMATS), help="default: by the codec")


def _export_options(command: argparse.ArgumentParser) -> None:
    command.add_argument("lightfield", type=Path, help="light field file, .mkv")
    command.add_argument("-o", "--output", type=Path, required=True, help="folder to write")
    command.add_argument("--format", required=True, metavar="NAME", help="see below")
    part = command.add_argument_group("a part of it")
    part.add_argument("--views", type=pair, metavar="CxR", help="columns and rows of views")
    part.add_argument("--baseline", type=length, metavar="L", help="between them: 6mm, 0.006m")
    part.add_argument("--crop", type=window, metavar="WxH+X+Y", help="pixels of every view")
    more = command.add_argument_group("more")
    more.add_argument("--scene", type=Path, help="what it was traced from: depth of every view")
    more.add_argument("--light-points", type=int, default=POINTS, metavar="K",
                      help="as when it was traced")  # fmt: skip
    more.add_argument("--order", metavar="ORDER", help="of JPEG Pleno's names: columns or rows")
    more.add_argument("--tiles", type=pair, metavar="CxR", help="of a quilt")
    more.add_argument("--count", type=int, default=60, metavar="K", help="pictures of a film (60)")
    more.add_argument("--near", type=float, metavar="M", help="nearest depth, metres")
    more.add_argument("--far", type=float, metavar="M", help="farthest depth, metres")
    more.add_argument("--device", help="part of an OpenCL device's name")


def pair(text: str) -> tuple[int, int]:
    """Two counts: ``9x9``."""
    match = re.fullmatch(r"(\d+)[x×](\d+)", text)
    if not match or not all(int(part) for part in match.groups()):
        raise argparse.ArgumentTypeError(f"not two counts like 9x9: {text!r}")
    return int(match[1]), int(match[2])


def window(text: str) -> tuple[int, int, int, int]:
    """Left, top, width and height of ``WxH+X+Y``."""
    match = re.fullmatch(r"(\d+)x(\d+)\+(\d+)\+(\d+)", text)
    if not match:
        raise argparse.ArgumentTypeError(f"not a window like 512x512+0+0: {text!r}")
    width, height, left, top = (int(part) for part in match.groups())
    return left, top, width, height


def length(text: str) -> float:
    """Metres of ``6mm``, ``0.6cm``, ``0.006m`` or ``0.006``."""
    match = re.fullmatch(r"([0-9.eE+-]+)\s*(mm|cm|m|)", text)
    try:
        return float(match[1]) * {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "": 1.0}[match[2]]
    except (TypeError, ValueError):
        raise argparse.ArgumentTypeError(f"not a length like 6mm: {text!r}") from None


def run_import(arguments: argparse.Namespace) -> None:
    from lfcore.exchange.grid import Geometry, Order
    from lfcore.exchange.importing import ReadOptions, import_lightfield

    check_suffix(arguments.output, (".mkv",))
    focus = arguments.focus
    if focus is not None and not focus > 0:
        raise LfcoreError(f"must be positive, not {focus:g}", key="--focus")
    options = ReadOptions(
        arguments.grid,
        Order.parse(arguments.order) if arguments.order else None,
        Geometry(arguments.baseline, None, None if focus is None else 1 / focus),
        arguments.field_of_view,
        arguments.variable,
    )
    with progress("encoding", "views") as report:
        made = import_lightfield(
            arguments.source, arguments.output, format=arguments.format, options=options,
            codec=arguments.codec, pixel_format=arguments.pixel_format, crf=arguments.crf,
            preset=arguments.preset, progress=report,
        )  # fmt: skip
    grid = made.grid
    for note in grid.notes:
        say(note)
    if grid.geometry.missing:
        say(f"the geometry is not known: {', '.join(grid.geometry.missing)} would say it; "
            "refocus by --disparity")  # fmt: skip
    size = arguments.output.stat().st_size
    say(f"wrote {arguments.output}: {FORMATS[grid.format].title.split(':')[0]}, {grid.columns} x "
        f"{grid.rows} views of {grid.width} x {grid.height}, {size:,} bytes")  # fmt: skip


def run_export(arguments: argparse.Namespace) -> None:
    from lfcore.cli.render import load
    from lfcore.exchange.exporting import WriteOptions, export_lightfield
    from lfcore.exchange.grid import Order
    from lfcore.exchange.source import Selection

    scene = load(arguments.scene, arguments.light_points) if arguments.scene else None
    with progress(f"writing {arguments.format}", "views") as report:
        notes = export_lightfield(
            arguments.lightfield,
            arguments.format,
            arguments.output,
            selection=Selection(arguments.views, arguments.baseline, arguments.crop),
            scene=scene,
            device=arguments.device,
            options=WriteOptions(
                Order.parse(arguments.order) if arguments.order else None, arguments.tiles,
                arguments.count, arguments.near, arguments.far, progress=report,
            ),
        )  # fmt: skip
    for note in notes:
        say(note)
    say(f"wrote {arguments.output}")
