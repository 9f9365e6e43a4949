"""``lfcore render`` and ``lfcore trace``."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import lfcore
from lfcore.cli import film
from lfcore.cli import planes as plane_options
from lfcore.cli.command import Command, asked, encoder, given, open_scene, refuse
from lfcore.cli.options import add_encoder, add_lens, add_output, add_scene, distance
from lfcore.cli.progress import note, progress, say, wrote
from lfcore.errors import OpticsError
from lfcore.pictures import check_bits, check_suffix

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
      with as few rays as that takes: rounds of rays until their disagreement says so
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
M x M pixels, as H.264 video or another codec. Unless --views says how many, they are few, and the
depth of every ray is stored beside it. SCENE is as for 'lfcore render'."""
TRACE_EPILOG = """\
examples:
  lfcore trace scenes/bike -o bike.mkv --size 256
      4 x 4 views of 512 x 512 and the depth of every ray: pictures of 256 x 256 by depth
  lfcore trace scenes/bike -o bike.mkv --size 128 --quality 45 --focus-range 2 10
      as many views and pixels as pictures focused there need
  lfcore trace scenes/bike -o bike.mkv --size 256 --views 32
      32 x 32 views of 256 x 256, each as it is, for any program
  lfcore trace table.glb -o table.mkv --size 512 --views 16 --layout views --crf 18
  lfcore trace table.glb -o table.mkv --size 128 --views 16 --codec ffv1     lossless video
  lfcore trace scene.pbrt -o scene.mkv
      a scene with Camera "lightfield": its own cameras, rays a pixel and shutter
"""


def render_options(command: argparse.ArgumentParser) -> None:
    add_scene(command)
    add_output(command, "picture to write")
    add_size(command)
    add = command.add_argument
    add(
        "--views", type=int, metavar="N", help="N x N lens samples (8, or 16 with --filter nearest)"
    )
    add(
        "--subpixels", type=float, metavar="Q",
        help="Q x Q rays of a pixel and lens sample (2; 1 with --filter nearest)",
    )  # fmt: skip
    add(
        "--filter", choices=("depth", "nearest"), default="depth",
        help="how a ray counts: over what its part of lens and pixel sweeps at the depth that "
        "it met (default), or in the pixel that it falls on",
    )  # fmt: skip
    add(
        "--quality", type=float, metavar="DB",
        help="as few rays as every picture needs for this PSNR against the average over its "
        "pixels and the lens, instead of --views and --subpixels",
    )  # fmt: skip
    add(
        "--most-rays", type=float, metavar="R",
        help="rays a pixel that --quality may take at most (4096)",
    )  # fmt: skip
    add(
        "--error-map", type=Path, metavar="FILE",
        help="with --quality: the error to be expected of each pixel, sRGB in [0, 1], as pictures",
    )  # fmt: skip
    add("--pinhole", action="store_true", help="one ray through a point")
    plane_options.add_options(command)
    film.add_options(command)


def trace_options(command: argparse.ArgumentParser) -> None:
    add_scene(command)
    add_output(command, "file to write, .mkv")
    add_size(command)
    command.add_argument(
        "--views", type=int, metavar="N", help="N x N views (4, or 16 with --no-depth)"
    )
    by_depth = command.add_argument_group("for pictures by depth")
    by_depth.add_argument(
        "--depth", action=argparse.BooleanOptionalAction,
        help="store the inverse depth of every ray beside it, so that few views do (default where "
        "--views is not given)",
    )  # fmt: skip
    by_depth.add_argument(
        "--subpixels", type=float, metavar="Q", help="views of Q times M pixels a side (2)"
    )
    by_depth.add_argument(
        "--displaced", action=argparse.BooleanOptionalAction, default=True,
        help="views displaced within a pixel against one another (default); the filters nearest "
        "and bilinear need views that are not",
    )  # fmt: skip
    by_depth.add_argument(
        "--quality", type=float, metavar="DB",
        help="as many views and pixels as pictures need for this PSNR against the average over "
        "their pixels and the lens, before the codec's loss; found by a pilot",
    )  # fmt: skip
    by_depth.add_argument(
        "--focus-range", type=distance, nargs=2, metavar=("NEAR", "FAR"),
        help="metres between which these pictures are focused (default: what is seen)",
    )  # fmt: skip
    by_depth.add_argument(
        "--most-rays", type=float, metavar="R", help="rays a pixel that it may take (4096)"
    )
    lens = command.add_argument_group("the lens (default: the scene's)")
    add_lens(lens, "metres, or 'inf'", "widest that can be refocused")
    how = add_encoder(command, of_array=True)
    how.add_argument("--layout", choices=("macropixels", "views"), help="default: by N and M")
    film.add_options(command)


def add_size(command: argparse.ArgumentParser) -> None:
    # None: not asked for, so that a scene with a film of its own is taken as it is.
    command.add_argument("--size", type=int, metavar="M", help="M x M pixels (256)")


def render(arguments: argparse.Namespace) -> None:
    import numpy as np

    from lfcore.colour import srgb_decode

    check_suffix(arguments.output)
    check_bits(arguments.output, arguments.bits)
    if arguments.error_map is not None:
        check_suffix(arguments.error_map)
    _check_rays(arguments)
    scene = open_scene(arguments)
    if film.wanted(arguments, scene):
        film.render(arguments, scene)
        return
    if arguments.pinhole:
        arguments.filter, arguments.views = "nearest", 1
    size = 256 if arguments.size is None else arguments.size
    planes = plane_options.read_planes(arguments, scene.camera)
    same = {"planes": planes, "pixels": size, "device": arguments.device}
    rays = _rays(arguments, size)
    with named_file(arguments.scene), progress("tracing", "parts", rays=rays) as report:
        if arguments.quality is None:
            lattice, filter = _lattice(arguments), arguments.filter
            pictures = lfcore.render(scene, views=lattice, filter=filter, progress=report, **same)
        else:
            quality = lfcore.Quality(arguments.quality, **given(arguments, "most_rays"))
            made = lfcore.render_to_quality(scene, quality, progress=report, **same)
            pictures = made.pictures
    if arguments.quality is not None:
        db = ", ".join(f"{each:.1f}" for each in made.expected_db)
        traced = f"{made.rays_per_pixel:.0f} rays per pixel in {len(made.lattices)} rounds"
        say(f"{traced}: {db} dB expected")
        note(expected_db=list(map(float, made.expected_db)), rays_per_pixel=made.rays_per_pixel)
        if arguments.error_map is not None:
            shown = srgb_decode(np.repeat(made.error[..., None], 3, axis=-1))
            plane_options.save(arguments.error_map, planes, shown, arguments.bits)
    plane_options.save(arguments.output, planes, pictures, arguments.bits)


def _check_rays(arguments: argparse.Namespace) -> None:
    """Options on rays that do not go together."""
    if arguments.pinhole and asked(arguments, ("views", "subpixels", "f_number", "plane")):
        remedy = "Leave out --views, --subpixels, --f-number and --plane"
        refuse("--pinhole", "has neither aperture nor focus", remedy)
    chosen = asked(arguments, ("views", "subpixels", "pinhole"))
    if arguments.quality is not None and (chosen or arguments.filter == "nearest"):
        remedy = "Leave out --views, --subpixels, --pinhole and --filter nearest"
        refuse("--quality", "chooses the rays itself", remedy)
    if arguments.quality is None and asked(arguments, ("most_rays", "error_map")):
        refuse("--quality", "is what --most-rays and --error-map belong to", "Give it, too")


def _rays(arguments: argparse.Namespace, size: int) -> int:
    """Rays that pictures are made of; 0 where their disagreement is to say how many."""
    return 0 if arguments.quality is not None else _lattice(arguments).rays(size)


def _lattice(arguments: argparse.Namespace) -> lfcore.Lattice:
    """The lattice that ``render`` traces."""
    from lfcore.api import lattice_to_trace

    return _with_subpixels(lattice_to_trace(arguments.filter, arguments.views), arguments)


def _with_subpixels(lattice: lfcore.Lattice, arguments: argparse.Namespace) -> lfcore.Lattice:
    return replace(lattice, **given(arguments, "subpixels"))


def trace(arguments: argparse.Namespace) -> None:
    from lfcore.api import lattice_to_store

    check_suffix(arguments.output, (".mkv",))
    scene = open_scene(arguments)
    if film.wanted(arguments, scene) and film.is_array(scene):
        film.trace(arguments, scene)
        return
    size = 256 if arguments.size is None else arguments.size
    depth, lattice = lattice_to_store(arguments.depth, arguments.views)
    if depth:
        lattice = replace(lattice, displaced=arguments.displaced)
    lattice, quality = _with_subpixels(lattice, arguments), _wanted_quality(arguments)
    encoding = replace(encoder(arguments), depth=depth)
    rays, what = lattice.rays(size), f"tracing {lattice.rays(size):,} rays"
    if quality:
        chosen = asked(arguments, ("views", "subpixels"))
        if chosen or arguments.depth is False:
            refuse("--quality", "chooses the rays itself, and stores their depths",
                   "Leave out --views, --subpixels and --no-depth")  # fmt: skip
        rays, what, encoding = 0, "tracing", replace(encoding, depth=True)
    with named_file(arguments.scene), progress(what, rays=rays) as report:
        field = lfcore.record(
            scene, arguments.output, views=None if quality else lattice, pixels=size,
            focus_m=arguments.focus, f_number=arguments.f_number, quality=quality,
            encoding=encoding, device=arguments.device, progress=report,
        )  # fmt: skip
    if quality:
        slab, expected = field.require_slab(), field.content["expected"]
        near, far = expected["focus_m"]
        size_of = f"{slab.views} x {slab.views} views of {slab.pixels} x {slab.pixels}"
        say(f"{size_of}: {expected['db']:g} dB expected before the codec, {near:g} to {far:g} m")
        note(expected_db=expected["db"], focus_range_m=[near, far])
    length = os.path.getsize(arguments.output)
    wrote(arguments.output, f": {len(field.segments)} segments, {length:,} bytes")


def _wanted_quality(arguments: argparse.Namespace) -> lfcore.Quality | None:
    """The quality that rays are chosen for, if any."""
    names = {"quality": "quality_db", "focus_range": "focus_range_m", "most_rays": "most_rays"}
    wanted = {names[name]: value for name, value in given(arguments, *names).items()}
    if wanted and arguments.quality is None:
        refuse("--quality", "is what --focus-range and --most-rays belong to", "Give it, too")
    return lfcore.Quality(**wanted) if wanted else None


@contextmanager
def named_file(file: Path) -> Iterator[None]:
    """Errors of optics within the block name the file whose lens it is."""
    try:
        yield
    except OpticsError as error:
        raise error.named(OpticsError, file=error.file or file) from None


COMMANDS = {
    "render": Command(RENDER, RENDER_EPILOG, render_options, render, programs=True),
    "trace": Command(TRACE, TRACE_EPILOG, trace_options, trace, programs=True),
}
