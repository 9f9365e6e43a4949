"""``lfcore render``: pictures straight from a scene; ``lfcore record``: a light field file."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import lfcore
from lfcore.cli import film, values
from lfcore.cli import planes as plane_options
from lfcore.cli.command import (
    Command,
    add,
    add_encoder,
    add_output,
    add_scene,
    check_output,
    encoder,
    flags,
    form,
    given,
    open_scene,
    refuse,
)
from lfcore.cli.progress import note, progress, say, wrote
from lfcore.errors import OpticsError
from lfcore.pictures import check_suffix

DESCRIPTION = """\
Trace a scene and make pictures from its rays, without storing a light field. SCENE is a
scene.yaml, a folder that holds one, a mesh (GLB, OBJ, PLY, STL, ...) or a .pbrt file."""
EPILOG = """\
examples:
  lfcore render model.glb -o picture.png --focus near
      any mesh: seen from the front left, with its nearest part in focus
  lfcore render model.glb -o picture.png --from right --focus-at 0.5,0.4 --blur 4%
      from the right, focused on a place of the picture, with twice the usual blur
  lfcore render example -o bike.png --pixels 512
      4 x 4 lens samples by 2 x 2 rays per pixel, each spread by its depth
  lfcore render table.glb -o table.png --focus 2.5 --f-number 1.4
  lfcore render example -o bike.png --quality-db 45
      with the fewest rays that reach 45 dB
  lfcore render scene.pbrt -o scene.exr
      as the file says: film, rays per pixel, lens or Camera "lightfield", shutter
  lfcore render example -o pinhole.png --views 1 --filter nearest
      a pinhole: one ray per pixel, all in focus
  lfcore render example -o bike.dng --sensor iso=800,bayer=RGGB
      the raw codes of a sensor, with noise
  lfcore render example -o bike.png --plane focus=2 --plane focus=6
      several pictures from the same rays
"""


def options(command: argparse.ArgumentParser) -> None:
    add_scene(command)
    add_output(command, "picture to write")
    add(
        command, "pixels",
        views="N x N lens samples (4, or 16 with --filter nearest)",
        subpixels="Q x Q rays per pixel and lens sample (2, or 1 with --filter nearest)",
        quality_db="the fewest rays with which every picture reaches this PSNR against the average "
        "over pixel and lens", most_rays="",
    )  # fmt: skip
    command.add_argument(
        "--filter", choices=("depth", "nearest"), default="depth",
        help="spread each ray over the area that its share of lens and pixel covers at its depth "
        "(default), or count it in the pixel that it hits",
    )  # fmt: skip
    add(command, "shutter")
    plane_options.add_options(command, of_file=False)
    film.add_options(command)


def run(arguments: argparse.Namespace) -> None:
    from lfcore.rendering.defaults import lattice_to_trace

    check_output(arguments)
    excluded = ["--filter nearest"] if arguments.filter == "nearest" else []
    quality = chosen_quality(arguments, flags(arguments, "views", "subpixels") + excluded)
    scene = open_scene(arguments)
    if film.wanted(arguments, scene):
        film.render(arguments, scene)
        return
    pixels = arguments.pixels or 256
    planes = plane_options.read_planes(arguments, scene, pixels)
    plane_options.report(planes)
    formed = plane_options.formed_planes(arguments, planes)
    same = {"planes": formed, "pixels": pixels, "device": arguments.device}
    lattice = lattice_to_trace(arguments.filter, arguments.views)
    lattice = replace(lattice, **given(arguments, "subpixels"))
    rays = 0 if quality else lattice.rays(pixels)
    with named_file(arguments.scene), progress("tracing", "parts", rays=rays) as report:
        if quality is None:
            same |= {"views": lattice, "filter": arguments.filter}
            pictures = lfcore.render(scene, progress=report, **same)
        else:
            rendering = lfcore.render_to_quality(scene, quality, progress=report, **same)
            pictures = rendering.pictures
    if quality:
        _report_quality(rendering)
    apart = plane_options.scene_disparities(arguments, planes, scene, pixels)
    plane_options.save(arguments.output, planes, pictures, form(arguments), disparities=apart)


def _report_quality(rendering: lfcore.Rendering) -> None:
    db = ", ".join(f"{each:.1f}" for each in rendering.expected_db)
    traced = f"{rendering.rays_per_pixel:.0f} rays per pixel ({rendering.lattice})"
    say(f"{traced}: {db} dB expected")
    note(
        expected_db=list(map(float, rendering.expected_db)), rays_per_pixel=rendering.rays_per_pixel
    )


def chosen_quality(
    arguments: argparse.Namespace, excluded: Sequence[str], *others: str, **more: Any
) -> lfcore.Quality | None:
    """The quality of ``--quality-db``, if given.

    It excludes the options ``excluded``; ``--most-rays`` and ``others`` need it.
    """
    if arguments.quality_db is None:
        if alone := flags(arguments, "most_rays", *others):
            refuse("--quality-db", f"is missing, and {alone[0]} needs it", "Give both")
        return None
    if excluded:
        refuse("--quality-db", "chooses the rays itself", f"Leave out {', '.join(excluded)}")
    return lfcore.Quality(arguments.quality_db, **given(arguments, "most_rays"), **more)


@contextmanager
def named_file(file: Path) -> Iterator[None]:
    """Errors of optics in the block name the file of the lens."""
    try:
        yield
    except OpticsError as error:
        raise error.named(OpticsError, file=error.file or file) from None


RECORD = """\
Trace a scene into a light field file, from which 'lfcore refocus' makes pictures. By default the
file holds few views and the depth of every ray, from which views between them are made. SCENE is as
for 'lfcore render'."""
RECORD_EPILOG = """\
examples:
  lfcore record example -o bike.mkv
      4 x 4 views of 512 x 512 with depth, for pictures of 256 x 256
  lfcore record example -o bike.mkv --pixels 128 --quality-db 45 --focus-range 2 10
      with the views and pixels that pictures focused there need
  lfcore record table.glb -o table.mkv --views 32
      for 32 x 32 views: 5 x 5 are traced, the others made by depth
  lfcore record table.glb -o table.mkv --views 16 --depth none --codec ffv1
      16 x 16 views as they are, without depth, as lossless video
  lfcore record walk.glb -o walk.mkv --frames 0:48 --fps 24
      a film of two seconds, whose focus is pulled afterwards
  lfcore record scene.pbrt -o scene.mkv
      a scene with Camera "lightfield": its own cameras, rays per pixel and shutter
"""
DEPTHS = {None: None, "displaced": True, "plain": True, "none": False}
"""Whether depth is stored, by the values of ``--depth``."""


def record_options(command: argparse.ArgumentParser) -> None:
    add_scene(command)
    add_output(command, "file to write (.mkv)")
    add(command, "pixels", views="the file provides N x N views (4, or 16 with --depth none). With "
        "depth it stores 4 x 4 views, or the square root of N per side if that is more, and makes "
        "the others; with --depth or --subpixels it stores N x N")  # fmt: skip
    by_depth = command.add_argument_group("for pictures by depth")
    by_depth.add_argument(
        "--depth", choices=[name for name in DEPTHS if name],
        help="store every ray's depth with displaced views (default), with plain views (for other "
        "filters), or not at all",
    )  # fmt: skip
    add(
        by_depth, subpixels="views of Q*M x Q*M pixels (2)",
        quality_db="the views, pixels and bits that pictures need for this PSNR against the "
        "average over pixel and lens", most_rays="",
    )  # fmt: skip
    by_depth.add_argument(
        "--focus-range", type=values.distance, nargs=2, metavar=("NEAR", "FAR"),
        help="metres between which these pictures are focused (default: the visible depth)",
    )  # fmt: skip
    many = command.add_argument_group("a film of a scene that moves")
    many.add_argument(
        "--frames", type=values.frames, metavar="A:B",
        help="all frames from A to before B, in one file; a record that is killed continues",
    )  # fmt: skip
    add(many, "shutter")
    many.add_argument("--fps", type=values.positive, metavar="N", help="frames per second (24)")
    many.add_argument(
        "--bake-each", action="store_true",
        help="bake the light of a sky and of bounces for every frame, not as the scene begins",
    )  # fmt: skip
    lens = command.add_argument_group("the lens (default: the scene's)")
    plane_options.add_focus(lens, of_file=False)
    add(add_encoder(command, "layout"), "white")
    film.add_options(command)


def record(arguments: argparse.Namespace) -> None:
    from lfcore.rendering.defaults import lattice_to_store

    check_suffix(arguments.output, (".mkv",))
    excluded = flags(arguments, "views", "subpixels", "depth")
    quality = chosen_quality(
        arguments, excluded, "focus_range", focus_range_m=arguments.focus_range
    )
    scene = open_scene(arguments)
    times = _times(arguments, scene)
    if times is not None and scene.shutter:
        scene = replace(scene, shutter=arguments.shutter)
    if film.wanted(arguments, scene) and film.is_array(scene) and times is None:
        film.record(arguments, scene)
        return
    pixels = arguments.pixels or 256
    depth, views = DEPTHS[arguments.depth], arguments.views
    if arguments.subpixels and depth is False:
        refuse("--subpixels", "is for views with depth", "Leave one out")
    if depth or arguments.subpixels:
        views = lfcore.Lattice(
            views or 4, displaced=arguments.depth != "plain", **given(arguments, "subpixels")
        )
    _, lattice = lattice_to_store(depth, views)
    rays = 0 if quality else lattice.rays(pixels) * len(times or [0])
    label = f"tracing {rays:,} rays" if rays else "tracing"
    with named_file(arguments.scene), progress(label, rays=rays) as report:
        field = lfcore.record(
            scene, arguments.output, views=None if quality else views, pixels=pixels,
            quality=quality, encoding=replace(encoder(arguments), depth=depth),
            device=arguments.device, progress=report, times=times, bake_each=arguments.bake_each,
            **plane_options.of_scene(arguments),
        )  # fmt: skip
    if "lens" in field.content:
        camera = field.require_slab().camera
        say(f"lens {field.content['lens']}: {2e3 * camera.lens_radius_m:.4g} mm wide, focus "
            f"{camera.focus_m:.4g} m; --f-number or --blur makes another")  # fmt: skip
    if quality:
        slab, expected = field.require_slab(), field.content["expected"]
        near, far = expected["focus_m"]
        size = f"{slab.views} x {slab.views} views of {slab.size}"
        say(f"{size}: {expected['db']:g} dB expected, {near:g} to {far:g} m")
        note(expected_db=expected["db"], focus_range_m=[near, far])
    wrote(arguments.output, f": {arguments.output.stat().st_size:,} bytes")


def _times(arguments: argparse.Namespace, scene: lfcore.Scene) -> list[float] | None:
    """The instants of a film, seconds."""
    if arguments.frames is None:
        if alone := flags(arguments, "fps", "bake_each"):
            refuse("--frames", f"is missing, and {alone[0]} needs it", "Give both")
        return None
    if arguments.time is not None:
        refuse("--time", "excludes --frames", "Leave one out")
    if scene.instants is None:
        refuse("--frames", "the scene does not move", "Leave it out")
    if scene.bake and not arguments.bake_each:
        say("light is baked as the scene begins; --bake-each bakes it for every frame")
    return [frame / (arguments.fps or 24.0) for frame in arguments.frames]


COMMANDS = {
    "render": Command(DESCRIPTION, EPILOG, options, run),
    "record": Command(RECORD, RECORD_EPILOG, record_options, record),
}
