"""``lfcore render`` and ``lfcore trace``."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from lfcore.cli import imgtool_store, render_view
from lfcore.cli import planes as plane_options
from lfcore.cli.command import add_command
from lfcore.cli.progress import progress, say
from lfcore.errors import OpticsError
from lfcore.pictures import check_bits, check_suffix
from lfcore.scene.emitters import POINTS
from lfcore.storage.pixels import PIXEL_FORMATS

if TYPE_CHECKING:
    from lfcore.scene.model import Scene

RENDER = """\
Trace a scene and make pictures from its rays at once; no light field is stored. SCENE is a
scene.yaml, a folder that holds one, a mesh (GLB, OBJ, PLY, STL, ...) or a .pbrt file."""
RENDER_EPILOG = """\
examples:
  lfcore render scenes/bike -o bike.png --size 512
      8 x 8 lens samples by 2 x 2 rays of a pixel, each spread by its depth over what it stands for
  lfcore render table.glb -o table.png --focus 2.5 --f-number 1.4
      a single picture is traced at its own focus
  lfcore render scenes/bike -o bike.png --quality 45
      with as few rays as that takes, found by a pilot
  lfcore render scene.pbrt -o scene.exr
      as the file says: film, rays a pixel, lens or Camera "lightfield", shutter
  lfcore render scene.pbrt -o square.exr --size 256 --pinhole
      one ray a pixel, all in focus
  lfcore render scenes/bike -o bike.png --plane focus=2 --plane focus=6
      several pictures from the same rays
  lfcore render scenes/bike -o bike.png --plane focus=2 --plane focus=6 --filter nearest --views 64
      as Algorithm 1 of the thesis: a ray counts in the pixel that it falls on
"""
TRACE = """\
Trace a scene into a light field file that 'lfcore refocus' makes pictures from: N x N views of
M x M pixels, as H.264 video or another codec. SCENE is as for 'lfcore render'."""
TRACE_EPILOG = """\
examples:
  lfcore trace scenes/bike -o bike.mkv --size 256 --views 32
  lfcore trace table.glb -o table.mkv --size 512 --views 16 --layout views --crf 18
  lfcore trace table.glb -o table.mkv --size 128 --views 16 --codec ffv1     lossless video
  lfcore trace scene.pbrt -o scene.mkv
      a scene with Camera "lightfield": its own cameras, rays a pixel and shutter
"""


def add_parser(commands, name: str, summary: str) -> None:
    text = (RENDER, RENDER_EPILOG) if name == "render" else (TRACE, TRACE_EPILOG)
    command = add_command(commands, name, summary, text[0], text[1])
    add_scene(command)
    if name == "render":
        command.add_argument("-o", "--output", type=Path, required=True, help="picture to write")
        command.add_argument(
            "--views", type=int, metavar="N",
            help="N x N lens samples (8, or 16 with --filter nearest)",
        )  # fmt: skip
        command.add_argument(
            "--subpixels", type=float, metavar="Q", help="Q x Q rays of a pixel and lens sample (2)"
        )
        command.add_argument(
            "--filter", choices=("depth", "nearest"), default="depth",
            help="how a ray counts: over what its part of lens and pixel sweeps at the depth that "
            "it met (default), or in the pixel that it falls on",
        )  # fmt: skip
        command.add_argument(
            "--quality", type=float, metavar="DB",
            help="as few rays as every picture needs for this PSNR against the average over its "
            "pixels and the lens, instead of --views and --subpixels",
        )  # fmt: skip
        command.add_argument("--pinhole", action="store_true", help="one ray through a point")
        plane_options.add_options(command)
        render_view.add_options(command)
        # None: not asked for, so that a scene with a film of its own is taken as it is.
        command.set_defaults(run=render, size=None)
        return
    command.add_argument("-o", "--output", type=Path, required=True, help="file to write, .mkv")
    command.add_argument("--views", type=int, metavar="N", help="N x N views (16)")
    lens = command.add_argument_group("the lens (default: the scene's)")
    lens.add_argument("--focus", type=plane_options.distance, metavar="M", help="metres, or 'inf'")
    lens.add_argument("--f-number", type=float, metavar="F", help="widest that can be refocused")
    how = imgtool_store.add_encoder(command)
    how.add_argument("--layout", choices=("macropixels", "views"), help="default: by N and M")
    how.add_argument("--pixel-format", choices=tuple(PIXEL_FORMATS), help="default: by N")
    render_view.add_options(command)
    command.set_defaults(run=trace, size=None)


def add_scene(command: argparse.ArgumentParser) -> None:
    """Options of every command that traces a scene."""
    command.add_argument("scene", type=Path, help="scene.yaml, its folder, a mesh or a .pbrt file")
    command.add_argument("--size", type=int, default=256, metavar="M", help="M x M pixels (256)")
    command.add_argument("--device", help="part of an OpenCL device's name")
    command.add_argument(
        "--light-points", type=int, default=POINTS, metavar="P",
        help=f"points of each area light of a pbrt scene ({POINTS})",
    )  # fmt: skip
    command.add_argument("--up", choices=("y", "z"), default="y", help="axis of a mesh (y)")


def load(path: Path, light_points: int = POINTS, up: str = "y") -> Scene:
    """As :func:`lfcore.load_scene`; what could not be read exactly is told."""
    from lfcore.api import load_scene

    scene = load_scene(path, light_points=light_points, up=up)
    if scene.notes:
        say(scene.summary())
    return scene


def say_what_is_in(scene) -> None:
    """How many triangles the scene has, and what was left out of it."""
    say(f"{scene.name}: {scene.triangle_count} triangles")
    for reason, count in scene.dropped.items():
        say(f"{count} triangles were left out: {reason}")


def render(arguments: argparse.Namespace) -> None:
    from lfcore import api
    from lfcore.cli.refocus import save

    check_suffix(arguments.output)
    check_bits(arguments.output, arguments.bits)
    _check_rays(arguments)
    scene = load(arguments.scene, arguments.light_points, arguments.up)
    say_what_is_in(scene)
    if render_view.wants_film(arguments, scene):
        render_view.render_film(arguments, scene)
        return
    size = 256 if arguments.size is None else arguments.size
    if arguments.quality is not None:
        _render_to_quality(arguments, scene, size)
        return
    views = 1 if arguments.pinhole else arguments.views
    how = "nearest" if arguments.pinhole else arguments.filter
    planes = plane_options.read_planes(arguments, scene.camera)
    with named_file(arguments.scene), progress("tracing", "parts") as report:
        pictures = api.render(
            scene, planes=planes, pixels=size, views=views, subpixels=arguments.subpixels,
            filter=how, device=arguments.device, progress=report,
        )  # fmt: skip
    save(arguments.output, planes, pictures, bits=arguments.bits)


def _check_rays(arguments: argparse.Namespace) -> None:
    """Options on rays that do not go together."""
    rays = arguments.views, arguments.subpixels
    if arguments.pinhole and any((*rays, arguments.f_number, arguments.plane)):
        raise OpticsError(
            "has neither aperture nor focus", key="--pinhole",
            remedy="Leave out --views, --subpixels, --f-number and --plane",
        )  # fmt: skip
    if arguments.quality is not None and (
        any(rays) or arguments.pinhole or arguments.filter == "nearest"
    ):
        raise OpticsError(
            "chooses the rays itself", key="--quality",
            remedy="Leave out --views, --subpixels, --pinhole and --filter nearest",
        )  # fmt: skip


def _render_to_quality(arguments: argparse.Namespace, scene, size: int) -> None:
    """Pictures of ``--quality``, and a line on what is expected of each."""
    from lfcore import api
    from lfcore.cli.refocus import save

    planes = plane_options.read_planes(arguments, scene.camera)
    with named_file(arguments.scene), progress("tracing", "views") as report:
        made = api.render_to_quality(
            scene, arguments.quality, planes=planes, pixels=size, device=arguments.device,
            progress=report,
        )  # fmt: skip
    db = ", ".join(f"{each:.1f}" for each in made.expected_db)
    rays = f"{made.count} lens samples by rays of a pixel a side"
    say(f"{rays}, {made.count.rays_a_pixel:g} a pixel: {db} dB expected")
    save(arguments.output, planes, made.pictures, bits=arguments.bits)


def trace(arguments: argparse.Namespace) -> None:
    from lfcore import api

    check_suffix(arguments.output, (".mkv",))
    scene = load(arguments.scene, arguments.light_points, arguments.up)
    say_what_is_in(scene)
    if render_view.wants_film(arguments, scene) and scene.view.kind == "lightfield":
        render_view.trace_film(arguments, scene)
        return
    views = 16 if arguments.views is None else arguments.views
    size = 256 if arguments.size is None else arguments.size
    with named_file(arguments.scene), progress(_what(views, size), "elements") as report:
        field = api.record(
            scene, arguments.output, views=views, pixels=size, focus_m=arguments.focus,
            f_number=arguments.f_number, layout=arguments.layout or "auto",
            device=arguments.device, progress=report, **imgtool_store.asked(arguments),
        )  # fmt: skip
    length = os.path.getsize(arguments.output)
    say(f"wrote {arguments.output}: {len(field.segments)} segments, {length:,} bytes")


def _what(views: int, size: int) -> str:
    return f"tracing {views**2 * size**2:,} rays"


@contextmanager
def named_file(file: Path) -> Iterator[None]:
    """Errors of optics within the block name the file whose lens it is."""
    try:
        yield
    except OpticsError as error:
        raise OpticsError(
            error.problem, file=error.file or file, key=error.key, remedy=error.remedy
        ) from None
