"""``lfcore view``: a page for the browser, or a view, macropixel or sheet of views as a picture."""

import argparse
import webbrowser

import numpy as np

import lfcore
from lfcore.cli import values
from lfcore.cli.command import (
    Command,
    add,
    add_lightfield,
    add_output,
    flags,
    given,
    open_field,
    refuse,
)
from lfcore.cli.progress import progress, say, wrote
from lfcore.pictures import SUFFIXES, check_codes, check_suffix, contact_sheet, write_picture

DESCRIPTION = """\
Look at a light field file in the browser, or write a page for it (-o NAME.html): look around,
focus, stop down and tilt the focal plane. Or write one view (the scene from one point of the lens)
or one macropixel (one pixel through the whole lens) as a picture. The page is one file, needs no
server and contacts no other host. A picture decodes only the frames that it needs."""
EPILOG = """\
examples:
  lfcore view bike.mkv                                in the browser: drag, click, slide
  lfcore view https://example.org/bike.mkv            from a URL
  lfcore view bike.mkv -o bike.html --pixels 128      the page as a file, a small one
  lfcore view bike.mkv --serve 8000                   at http://127.0.0.1:8000/
  lfcore view bike.mkv -o corner.png --view 0 3       lens column 0, row 3
  lfcore view bike.mkv -o between.png --view 12.5mm -40mm    between views, of a file with depth
  lfcore view bike.mkv -o lens.png --macropixel 64 32
  lfcore view bike.mkv -o sheet.png --grid 3          3 x 3 views, evenly from the whole lens
"""
PAGES = (".html", ".htm")
OF_PICTURES = ("view", "macropixel", "exposure")
OF_PAGES = ("pixels", "format", "jpeg_quality", "serve")


def options(command: argparse.ArgumentParser) -> None:
    add_lightfield(command)
    add_output(command, "page (.html) or picture to write", required=False)
    which = command.add_argument_group("which views").add_mutually_exclusive_group()
    which.add_argument(
        "--grid", type=values.views, metavar="K",
        help="K x K views: side by side in a picture, or 9 to 33 in a page (17)",
    )  # fmt: skip
    which.add_argument(
        "--view", nargs=2, type=_lens_place, metavar=("I", "J"),
        help="lens column and row; with depth also millimetres from the lens's middle: 12.5mm 4mm",
    )  # fmt: skip
    which.add_argument(
        "--macropixel", nargs=2, type=values.count(0), metavar=("U", "V"), help="column, row"
    )
    add(command, "exposure")
    page = command.add_argument_group("a page")
    add(page, pixels="pixels of a picture's longer side (at most 512)")
    page.add_argument(
        "--format", choices=("jpeg", "webp"),
        help="of the page's views: webp (default with depth) or jpeg (default without)",
    )  # fmt: skip
    page.add_argument(
        "--jpeg-quality", type=values.count(1, 100), metavar="Q",
        help="JPEG's or WebP's, of the page's views (with depth by their error, else 90)",
    )  # fmt: skip
    page.add_argument(
        "--serve", type=values.count(0, 65535), nargs="?", const=0, metavar="PORT",
        help="serve the page on this machine until interrupted",
    )  # fmt: skip
    add(command, "device")


def _lens_place(text: str) -> int | float:
    """Read a column or row, or a distance from the middle of the lens: metres of millimetres."""
    return values.number()(text[:-2]) / 1000 if text.endswith("mm") else values.count(0)(text)


def run(arguments: argparse.Namespace) -> None:
    output = arguments.output
    if output is None and flags(arguments, *OF_PICTURES):
        refuse("--output", "is missing", "Name a picture to write")
    if arguments.json and (output is None or arguments.serve is not None):
        refuse("--json", "reports on a file", "Give --output, and no --serve")
    is_page = output is None or output.suffix.lower() in PAGES
    if not is_page:
        check_suffix(output, (*SUFFIXES, *PAGES))
    if wrong := flags(arguments, *(OF_PICTURES if is_page else OF_PAGES)):
        kind, name = ("picture", ".png") if is_page else ("page", ".html")
        refuse(wrong[0], f"is for a {kind}", f"Write a {name}, or leave it out")
    (_page if is_page else _picture)(arguments)


def _page(arguments: argparse.Namespace) -> None:
    field = open_field(arguments, film=True)
    with progress("reading views", "frames") as report:
        page = field.viewer(
            **given(arguments, "grid", "pixels", "format", "jpeg_quality", "device"),
            film=arguments.instant is None, progress=report,
        )  # fmt: skip
    if arguments.output is not None:
        page.save(arguments.output)
        wrote(arguments.output, f", {len(page.html):,} bytes")
        if arguments.serve is None:
            return
    with page.server(arguments.serve or 0) as server:
        address = f"http://127.0.0.1:{server.server_address[1]}/"
        say(f"the page is at {address} until you interrupt this (Ctrl+C)")
        if arguments.serve is None:
            webbrowser.open(address)
        server.serve_forever()


def _picture(arguments: argparse.Namespace) -> None:
    check_codes(arguments.output, 8, bool(arguments.exposure))
    field = open_field(arguments)
    codes = field.layout.peak is None and not arguments.exposure
    if arguments.macropixel:
        picture = field.macropixel(*arguments.macropixel, codes=codes)
    elif arguments.grid:
        picture = _grid(field, arguments)
    else:
        place = arguments.view or [side // 2 for side in field.grid]
        kinds = {type(coordinate) for coordinate in place}
        if len(kinds) > 1:
            refuse("--view", "mixes a column or row with mm", "Give both in mm")
        if kinds == {float}:
            picture = field.views_at(np.array([place]), device=arguments.device)[0]
        else:
            picture = field.view(*place, codes=codes)
    write_picture(arguments.output, picture, **arguments.exposure)
    wrote(arguments.output, f"; {field.video.decoded_frames} frames were decoded")


def _grid(field: lfcore.LightField, arguments: argparse.Namespace) -> np.ndarray:
    from lfcore.refocus.free_views import served_positions
    from lfcore.refocus.stored_views import read_views

    count = arguments.grid
    if field.displaced:
        places = served_positions(field, count)
        points = np.stack(np.meshgrid(places, places), -1).reshape(-1, 2)
        with progress("making views", "views") as report:
            views = field.views_at(points, device=arguments.device, progress=report)
        return contact_sheet(views, count)
    columns, rows = (_spread(count, there) for there in field.grid)
    samples = np.array([(i, j) for j in rows for i in columns])
    with progress("reading views", "frames") as report:
        views = read_views(field, samples, device=arguments.device, progress=report)
    return contact_sheet(views, count)


def _spread(count: int, views: int) -> np.ndarray:
    """The numbers of ``count`` columns or rows among ``views``, from end to end."""
    if count > views:
        refuse("--grid", f"must be from 1 to {views}, not {count}")
    if count == 1:
        return np.array([views // 2])
    return np.rint(np.linspace(0, views - 1, count)).astype(int)


COMMANDS = {"view": Command(DESCRIPTION, EPILOG, options, run)}
