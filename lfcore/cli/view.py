"""``lfcore view``: a page for the browser, or a view, macropixel or sheet of views as a picture."""

from __future__ import annotations

import argparse
import http.server
import webbrowser
from pathlib import Path

import numpy as np

from lfcore.cli.command import add_command
from lfcore.cli.progress import progress, say
from lfcore.cli.refocus import open_field
from lfcore.errors import OpticsError, StorageError
from lfcore.pictures import SUFFIXES, check_suffix, write_picture

DESCRIPTION = """\
Look at a light field file: as a page for the browser (-o NAME.html), where you look around, focus,
stop down and tilt the focal plane; or, as a picture, one view (what is seen from one point of the
lens) or one macropixel (what one pixel sees through the whole lens). The page is one file, needs
no server and asks no other host. Of a picture, only what is needed is decoded."""
EPILOG = """\
examples:
  lfcore view bike.mkv -o bike.html                  a page: drag, click, slide
  lfcore view bike.mkv -o bike.html --open           and open it in the browser
  lfcore view bike.mkv -o bike.html --views 9 --size 256   a small one
  lfcore view bike.mkv --serve 8000                  hand it out at http://127.0.0.1:8000/
  lfcore view bike.mkv -o centre.png                 the central view
  lfcore view bike.mkv --view 0 15 -o corner.png     lens column 0, row 15
  lfcore view bike.mkv --macropixel 64 32 -o lens.png  of pixel column 64, row 32
  lfcore view bike.mkv --grid 5 -o sheet.png         5 x 5 views, evenly from the whole lens
"""
PAGES = (".html", ".htm")
OF_PICTURES, OF_PAGES = ("view", "macropixel", "grid"), ("views", "size", "format", "quality")


def add_parser(commands, name: str, summary: str) -> None:
    command = add_command(commands, name, summary, DESCRIPTION, EPILOG)
    command.add_argument("lightfield", help="light field file, .mkv, or its URL")
    command.add_argument("--salvage", action="store_true", help="open a damaged file, too")
    command.add_argument("-o", "--output", type=Path, help="page (.html) or picture to write")
    picture = command.add_argument_group("a picture")
    what = picture.add_mutually_exclusive_group()
    what.add_argument("--view", nargs=2, type=int, metavar=("I", "J"), help="lens column and row")
    what.add_argument("--macropixel", nargs=2, type=int, metavar=("U", "V"), help="column, row")
    what.add_argument("--grid", type=int, metavar="K", help="K x K views side by side")
    page = command.add_argument_group("a page")
    page.add_argument("--views", type=int, metavar="K", help="K x K views, 9 to 33 (17)")
    page.add_argument("--size", type=int, metavar="PX", help="pixels of a view (at most 512)")
    page.add_argument(
        "--format", choices=("webp", "avif"), help="webp (default, fast) or avif (whole chroma)"
    )
    page.add_argument("--quality", type=int, metavar="Q", help="of these, 1 to 100 (90)")
    page.add_argument("--open", action="store_true", help="open the page in the browser")
    page.add_argument(
        "--serve", type=int, nargs="?", const=0, metavar="PORT",
        help="hand the page out on this machine until interrupted",
    )  # fmt: skip
    page.add_argument("--device", help="part of an OpenCL device's name; see 'lfcore devices'")
    command.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    output, serves = arguments.output, arguments.serve is not None
    if output is None and not serves:
        raise OpticsError("is missing", key="--output", remedy="Name a page or a picture to write")
    is_page = output is None or output.suffix.lower() in PAGES
    if not is_page:
        check_suffix(output, (*SUFFIXES, *PAGES))
    given = vars(arguments)
    wrong = [name for name in (OF_PICTURES if is_page else OF_PAGES) if given[name] is not None]
    if not is_page:
        wrong += [name for name in ("open", "serve") if given[name] not in (None, False)]
    if wrong:
        kind = "picture" if is_page else "page"
        name = ".png" if is_page else ".html"
        raise OpticsError(
            f"belongs to a {kind}", key=f"--{wrong[0]}", remedy=f"Write a {name}, or leave it out"
        )
    (_page if is_page else _picture)(arguments)


def _page(arguments: argparse.Namespace) -> None:
    from lfcore.opencl.device import open_device

    field = open_field(arguments)
    with progress("reading views", "frames") as report:
        page = field.viewer(
            views=arguments.views, size=arguments.size, form=arguments.format or "webp",
            quality=90 if arguments.quality is None else arguments.quality,
            device=open_device(arguments.device), progress=report,
        )  # fmt: skip
    if arguments.output is not None:
        page.save(arguments.output)
        say(f"wrote {arguments.output}, {len(page.html):,} bytes")
        if arguments.open and arguments.serve is None:
            webbrowser.open(arguments.output.resolve().as_uri())
    if arguments.serve is not None:
        _serve(page.html.encode(), arguments.serve, arguments.open)


def _serve(page: bytes, port: int, open_it: bool) -> None:
    """Hand the page out, to this machine alone, until interrupted."""

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.send_header("Content-Length", str(len(page)))
            self.end_headers()
            self.wfile.write(page)

        def log_message(self, format: str, *arguments: object) -> None:
            pass

    try:
        server = http.server.ThreadingHTTPServer(("127.0.0.1", port), Handler)
    except (OSError, OverflowError) as error:
        raise StorageError(
            f"port {port} cannot be used: {getattr(error, 'strerror', None) or error}",
            key="--serve", remedy="Name another port, or none",
        ) from None  # fmt: skip
    with server:
        address = f"http://127.0.0.1:{server.server_address[1]}/"
        say(f"the page is at {address} until you interrupt this (Ctrl+C)")
        if open_it:
            webbrowser.open(address)
        server.serve_forever()


def _picture(arguments: argparse.Namespace) -> None:
    field = open_field(arguments)
    if arguments.macropixel:
        picture = field.macropixel(*arguments.macropixel)
    elif arguments.grid:
        picture = _grid(field, arguments.grid)
    else:
        picture = field.view(*(arguments.view or (side // 2 for side in field.grid)))
    write_picture(arguments.output, picture)
    say(f"wrote {arguments.output}; {field.count.frames} frames were decoded")


def _grid(field, count: int) -> np.ndarray:
    """``count`` x ``count`` views side by side, from corner to corner of the lens."""
    from lfcore.refocus.views import read_views

    chosen = [_spread(count, there) for there in field.grid]
    samples = np.array([(i, j) for j in chosen[1] for i in chosen[0]])
    with progress("reading views", "frames") as report:
        light = read_views(field, samples, progress=report)
    width, height = field.picture_size
    cells = light.reshape(count, count, height, width, 3).transpose(0, 2, 1, 3, 4)
    return cells.reshape(count * height, count * width, 3)


def _spread(count: int, views: int) -> np.ndarray:
    """``count`` of ``views`` columns or rows, from end to end."""
    if not 1 <= count <= views:
        raise OpticsError(f"must be from 1 to {views}, not {count}", key="--grid")
    if count == 1:
        return np.array([views // 2])
    return np.rint(np.linspace(0, views - 1, count)).astype(int)
