"""``lfcore view``: a page for the browser, or a view, macropixel or sheet of views as a picture."""

from __future__ import annotations

import argparse
import webbrowser
from pathlib import Path

import numpy as np

import lfcore
from lfcore.cli.command import Command, asked, open_field, refuse
from lfcore.cli.options import add_device, add_lightfield
from lfcore.cli.progress import progress, say, wrote
from lfcore.pictures import SUFFIXES, check_suffix, contact_sheet, write_picture

DESCRIPTION = """\
Look at a light field file in the browser, or write a page for it (-o NAME.html): look around,
focus, stop down and tilt the focal plane. Or write one view (what is seen from one point of the
lens) or one macropixel (what one pixel sees through the whole lens) as a picture. The page is one
file, needs no server and asks no other host. Of a picture, only what is needed is decoded."""
EPILOG = """\
examples:
  lfcore view bike.mkv                               in the browser: drag, click, slide
  lfcore view https://example.org/bike.mkv           of a URL, of which it reads what it needs
  lfcore view bike.mkv -o bike.html                  the page as a file of its own
  lfcore view bike.mkv -o bike.html --views 9 --size 256   a small one
  lfcore view bike.mkv --serve 8000                  hand the page out at http://127.0.0.1:8000/
  lfcore view bike.mkv -o centre.png                 the central view
  lfcore view bike.mkv --view 0 15 -o corner.png     lens column 0, row 15
  lfcore view few.mkv --at 12.5 -40 -o between.png   any point of the lens, of a file with depth
  lfcore view bike.mkv --macropixel 64 32 -o lens.png  of pixel column 64, row 32
  lfcore view bike.mkv --grid 5 -o sheet.png         5 x 5 views, evenly from the whole lens
"""
PAGES = (".html", ".htm")
OF_PICTURES = ("view", "at", "macropixel", "grid")
OF_PAGES = ("views", "size", "format", "quality", "open", "serve")


def options(command: argparse.ArgumentParser) -> None:
    add_lightfield(command)
    command.add_argument("-o", "--output", type=Path, help="page (.html) or picture to write")
    picture = command.add_argument_group("a picture")
    what = picture.add_mutually_exclusive_group()
    what.add_argument("--view", nargs=2, type=int, metavar=("I", "J"), help="lens column and row")
    what.add_argument(
        "--at", nargs=2, type=float, metavar=("S", "T"),
        help="mm to the right and down of the middle of the lens, of a file with depth",
    )  # fmt: skip
    what.add_argument("--macropixel", nargs=2, type=int, metavar=("U", "V"), help="column, row")
    what.add_argument("--grid", type=int, metavar="K", help="K x K views side by side")
    page = command.add_argument_group("a page")
    page.add_argument(
        "--views", type=int, metavar="K", help="K x K views, 9 to 33 (17, or 9 made by depth)"
    )
    page.add_argument("--size", type=int, metavar="PX", help="pixels of a view (at most 512)")
    page.add_argument(
        "--format",
        choices=("avif", "webp"),
        help="of the views: avif (default), or webp for browsers before 2024, which blurs colours",
    )
    page.add_argument("--quality", type=int, metavar="Q", help="of these, 1 to 100 (90)")
    page.add_argument("--open", action="store_true", help="open the page in the browser")
    page.add_argument(
        "--serve", type=int, nargs="?", const=0, metavar="PORT",
        help="hand the page out on this machine until interrupted",
    )  # fmt: skip
    add_device(page)


def run(arguments: argparse.Namespace) -> None:
    output = arguments.output
    if output is None and asked(arguments, OF_PICTURES):
        refuse("--output", "is missing", "Name a picture to write")
    if output is None and arguments.serve is None:
        arguments.serve, arguments.open = 0, True
    is_page = output is None or output.suffix.lower() in PAGES
    if not is_page:
        check_suffix(output, (*SUFFIXES, *PAGES))
    if wrong := asked(arguments, OF_PICTURES if is_page else OF_PAGES):
        kind, name = ("picture", ".png") if is_page else ("page", ".html")
        refuse(wrong[0], f"belongs to a {kind}", f"Write a {name}, or leave it out")
    (_page if is_page else _picture)(arguments)


def _page(arguments: argparse.Namespace) -> None:
    field = open_field(arguments)
    with progress("reading views", "frames") as report:
        page = field.viewer(
            views=arguments.views, size=arguments.size, form=arguments.format or "avif",
            quality=90 if arguments.quality is None else arguments.quality,
            device=lfcore.open_device(arguments.device), progress=report,
        )  # fmt: skip
    if arguments.output is not None:
        page.save(arguments.output)
        wrote(arguments.output, f", {len(page.html):,} bytes")
        if arguments.open and arguments.serve is None:
            webbrowser.open(arguments.output.resolve().as_uri())
    if arguments.serve is not None:
        with page.server(arguments.serve) as server:
            address = f"http://127.0.0.1:{server.server_address[1]}/"
            say(f"the page is at {address} until you interrupt this (Ctrl+C)")
            if arguments.open:
                webbrowser.open(address)
            server.serve_forever()


def _picture(arguments: argparse.Namespace) -> None:
    field = open_field(arguments)
    if arguments.macropixel:
        picture = field.macropixel(*arguments.macropixel)
    elif arguments.grid:
        picture = _grid(field, arguments.grid)
    elif arguments.at:
        picture = field.views_at(np.array([arguments.at]) / 1000)[0]
    else:
        picture = field.view(*(arguments.view or (side // 2 for side in field.grid)))
    write_picture(arguments.output, picture)
    wrote(arguments.output, f"; {field.count.frames} frames were decoded")


def _grid(field: lfcore.LightField, count: int) -> np.ndarray:
    """``count`` x ``count`` views side by side, from corner to corner of the lens."""
    from lfcore.refocus.views import read_views

    columns, rows = (_spread(count, there) for there in field.grid)
    samples = np.array([(i, j) for j in rows for i in columns])
    with progress("reading views", "frames") as report:
        return contact_sheet(read_views(field, samples, progress=report), count)


def _spread(count: int, views: int) -> np.ndarray:
    """``count`` of ``views`` columns or rows, from end to end."""
    if not 1 <= count <= views:
        refuse("--grid", f"must be from 1 to {views}, not {count}")
    if count == 1:
        return np.array([views // 2])
    return np.rint(np.linspace(0, views - 1, count)).astype(int)


COMMANDS = {"view": Command(DESCRIPTION, EPILOG, options, run)}
