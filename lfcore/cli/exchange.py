"""``lfcore import`` and ``lfcore export``: light fields of other programs."""

import argparse
from pathlib import Path

import lfcore
from lfcore.cli import values
from lfcore.cli.command import (
    Command,
    add,
    add_encoder,
    add_output,
    add_scene,
    encoder,
    flag,
    open_scene,
)
from lfcore.cli.progress import progress, say, wrote
from lfcore.exchange.table import FORMATS
from lfcore.pictures import check_suffix

IMPORT = """\
Make a light field file from another program's light field. The format is recognised by names and
headers. --baseline, --field-of-view and --focus give a geometry that the format lacks; without them
the file can be refocused in pixels of disparity, but not in metres."""
IMPORT_EPILOG = """\
examples:
  lfcore import boxes/ -o boxes.mkv                       a scene of the HCI benchmark
  lfcore import shots/ -o shots.mkv --views 8x5 --order columns-up
  lfcore import views/ -o lf.mkv --baseline 6mm --field-of-view 40 --focus 1.2
  lfcore import views/ -o exact.mkv --codec ffv1          8-bit RGB to the last bit

formats:
"""
EXPORT = """\
Write a light field file in another program's format, into a folder that appears whole or not at
all. --views, --baseline and --crop select a part of it. A file with depth gives any number of
views: views between the recorded ones are made by depth, and their quality is reported."""
EXPORT_EPILOG = """\
examples:
  lfcore export bike.mkv --format hci --scene example -o bike_hci
      depth, disparity and materials of every view traced again, not those of the file
  lfcore export bike.mkv --format hci --views 9x9 --baseline 6mm -o bike_9x9
  lfcore export bike.mkv --format nerfstudio -o bike_nerf
  lfcore export bike.mkv --format quilt:8x6 -o quilt

formats:
"""


def _formats(can: str) -> str:
    rows = [row for row in FORMATS.values() if getattr(row, can)]
    return "\n".join(f"  {row.name:<12} {row.title}" for row in rows)


def import_options(command: argparse.ArgumentParser) -> None:
    command.add_argument("source", type=Path, help="folder or file")
    add_output(command, "file to write (.mkv)")
    command.add_argument(
        "--format", metavar="NAME[:VARIABLE]", default="",
        help="see below (recognised), and the variable of a .mat or .h5 file (LF)",
    )  # fmt: skip
    group = command.add_argument_group("facts that the format lacks")
    more = group.add_argument
    more("--views", type=values.pair, metavar="CxR", help="columns and rows of views")
    more("--order", metavar="ORDER", help="rows or columns, then -left, -up, -snake: rows-up")
    more("--field-of-view", type=values.angle, metavar="DEG", help="of a view's width")
    add(group, "baseline", focus="metres at which the views coincide; 'inf' for parallel ones")
    add_encoder(command)


def export_options(command: argparse.ArgumentParser) -> None:
    command.add_argument("lightfield", help="light field file (.mkv), or its URL")
    add(command, instant="of a film, from 0 (all, in folders with their numbers)")
    add_output(command, "folder to write")
    command.add_argument(
        "--format", required=True, type=_format_and_tiles, metavar="NAME",
        help="see below; a quilt's columns and rows may follow: quilt:8x6",
    )  # fmt: skip
    part = command.add_argument_group("a part of it")
    part.add_argument("--views", type=values.pair, metavar="CxR", help="columns and rows of views")
    add(part, "baseline", pixels="M x M pixels, of a file with depth (as recorded for)")
    part.add_argument("--crop", type=values.window, metavar="WxH+X+Y", help="pixels of every view")
    add(part, "exposure")
    group = command.add_argument_group("more")
    add_scene(group, "--scene", "the scene that was recorded: traces depth of every view")
    more = group.add_argument
    more("--order", metavar="ORDER", help="of JPEG Pleno's names: columns or rows")


def _format_and_tiles(text: str) -> tuple[str, tuple[int, int] | None]:
    name, _, tiles = text.partition(":")
    if tiles and name != "quilt":
        raise argparse.ArgumentTypeError(f"{name} has no tiles")
    return name, values.pair(tiles) if tiles else None


def run_import(arguments: argparse.Namespace) -> None:
    from lfcore.exchange.grid import Geometry, Order, ReadOptions

    check_suffix(arguments.output, (".mkv",))
    focus = arguments.focus
    geometry = Geometry(arguments.baseline, None, None if focus is None else 1 / focus)
    order = Order.parse(arguments.order) if arguments.order else None
    format, _, variable = arguments.format.partition(":")
    options = ReadOptions(
        arguments.views, order, geometry, arguments.field_of_view, variable or None
    )
    with progress("encoding", "views") as report:
        field = lfcore.import_lightfield(
            arguments.source, arguments.output, format=format or None, options=options,
            encoding=encoder(arguments), progress=report,
        )  # fmt: skip
    source = field.content["source"]
    for note in source.get("notes", ()):
        say(note)
    if not field.metric:
        known = {key: source.get(key) for key in ("pitch_m", "pixel_pitch", "delta")}
        missing = ", ".join(map(flag, Geometry(**known).missing))
        say(f"the geometry is not known; give {missing}, or refocus in pixels, --focus 1.5px")
    size, (columns, rows) = arguments.output.stat().st_size, field.grid
    *_, width, height = field.require_slab().held.pixels
    wrote(arguments.output, f": {FORMATS[source['format']].title.split(':')[0]}, {columns} x "
          f"{rows} views of {width} x {height}, {size:,} bytes")  # fmt: skip


def run_export(arguments: argparse.Namespace) -> None:
    from lfcore.exchange.exporting import check_new, whole_folder

    scene = open_scene(arguments) if arguments.scene else None
    film, output = lfcore.LightField.open(arguments.lightfield), arguments.output

    def export(number: int, folder: Path) -> None:
        now = scene.at(film.times[number]) if scene and scene.instants else scene
        _export(arguments, film.at(number), folder, now)

    if len(film.times) == 1 or arguments.instant is not None:
        export(arguments.instant or 0, output)
    else:
        check_new(output)
        with whole_folder(output) as stage:
            for number in range(len(film.times)):
                export(number, stage / f"{number:04d}")
    wrote(output)


def _export(
    arguments: argparse.Namespace, field: lfcore.LightField, folder: Path,
    scene: lfcore.Scene | None,
) -> None:  # fmt: skip
    from lfcore.exchange.grid import Order, WriteOptions
    from lfcore.exchange.source import Selection

    format, tiles = arguments.format
    with progress(f"writing {format}", "views") as report:
        notes = lfcore.export_lightfield(
            field,
            format,
            folder,
            selection=Selection(
                arguments.views, arguments.baseline, arguments.crop, arguments.pixels,
                **arguments.exposure,
            ),
            scene=scene,
            device=arguments.device,
            options=WriteOptions(
                Order.parse(arguments.order) if arguments.order else None, tiles,
                progress=report,
            ),
        )  # fmt: skip
    for note in notes:
        say(note)


COMMANDS = {
    "import": Command(IMPORT, IMPORT_EPILOG + _formats("imports"), import_options, run_import),
    "export": Command(EXPORT, EXPORT_EPILOG + _formats("exports"), export_options, run_export),
}
