"""``lfcore record``: a light field file from a scene."""

import argparse
import os
from dataclasses import replace

import lfcore
from lfcore.cli import film, values
from lfcore.cli import planes as plane_options
from lfcore.cli.command import Command, open_scene, refuse
from lfcore.cli.options import add, add_encoder, add_output, add_scene, encoder, flags
from lfcore.cli.progress import note, progress, say, wrote
from lfcore.cli.render import chosen_quality, named_file, with_subpixels
from lfcore.pictures import check_suffix

DESCRIPTION = """\
Trace a scene into a light field file, from which 'lfcore refocus' makes pictures. By default it
holds few views and the depth of every ray, from which all views between them are made. SCENE is as
for 'lfcore render'."""
EPILOG = """\
examples:
  lfcore record scenes/bike -o bike.mkv
      4 x 4 views of 512 x 512 with depth, for pictures of 256 x 256
  lfcore record scenes/bike -o bike.mkv --pixels 128 --quality-db 45 --focus-range 2 10
      as many views and pixels as pictures focused there need
  lfcore record table.glb -o table.mkv --views 32
      for 32 x 32 views: 5 x 5 are traced, the others made by depth
  lfcore record table.glb -o table.mkv --views 16 --depth none --codec ffv1
      16 x 16 views as they are, without depth, as lossless video
  lfcore record scene.pbrt -o scene.mkv
      a scene with Camera "lightfield": its own cameras, rays per pixel and shutter
"""
DEPTHS = {None: None, "displaced": True, "plain": True, "none": False}
"""Whether depth is stored, by the values of ``--depth``."""


def options(command: argparse.ArgumentParser) -> None:
    add_scene(command)
    add_output(command, "file to write (.mkv)")
    add(command, "pixels", views="the file is for N x N views: 4 x 4 are traced, beyond N = 16 its "
        "root; with --depth or --subpixels N x N are (4, or 16 with --depth none)")  # fmt: skip
    by_depth = command.add_argument_group("for pictures by depth")
    by_depth.add_argument(
        "--depth", choices=[name for name in DEPTHS if name],
        help="store every ray's depth: with views displaced within a pixel against one another "
        "(default), with plain views (for other filters), or not at all",
    )  # fmt: skip
    add(
        by_depth, subpixels="views of Q*M x Q*M pixels (2)",
        quality_db="as many views, pixels and bits as stored pictures need for this PSNR against "
        "the average over pixel and lens", most_rays="",
    )  # fmt: skip
    by_depth.add_argument(
        "--focus-range", type=values.distance, nargs=2, metavar=("NEAR", "FAR"),
        help="metres between which those pictures are focused (default: all that is seen)",
    )  # fmt: skip
    lens = command.add_argument_group("the lens (default: the scene's)")
    plane_options.add_focus(lens, of_file=False)
    add(add_encoder(command, "layout"), "white")
    film.add_options(command)


def run(arguments: argparse.Namespace) -> None:
    from lfcore.api import lattice_to_store

    check_suffix(arguments.output, (".mkv",))
    excluded = flags(arguments, "views", "subpixels", "depth")
    quality = chosen_quality(
        arguments, "focus_range", excluded, focus_range_m=arguments.focus_range
    )
    scene = open_scene(arguments)
    if film.wanted(arguments, scene) and film.is_array(scene):
        film.record(arguments, scene)
        return
    pixels = arguments.pixels or 256
    depth, views = DEPTHS[arguments.depth], arguments.views
    if arguments.subpixels and depth is False:
        refuse("--subpixels", "belongs to views with depth", "Leave one out")
    if depth or arguments.subpixels:
        views = lfcore.Lattice(views or 4, displaced=arguments.depth != "plain")
        views = with_subpixels(views, arguments)
    _, lattice = lattice_to_store(depth, views)
    rays = 0 if quality else lattice.rays(pixels)
    what = f"tracing {rays:,} rays" if rays else "tracing"
    with named_file(arguments.scene), progress(what, rays=rays) as report:
        field = lfcore.record(
            scene, arguments.output, views=None if quality else views, pixels=pixels,
            quality=quality, encoding=replace(encoder(arguments), depth=depth),
            device=arguments.device, progress=report, **plane_options.of_scene(arguments),
        )  # fmt: skip
    if "lens" in field.content:
        camera = field.require_slab().camera
        say(f"lens {field.content['lens']}: {2e3 * camera.lens_radius_m:.4g} mm wide, focus "
            f"{camera.focus_m:.4g} m; --f-number or --blur makes another")  # fmt: skip
    if quality:
        _report_quality(field)
    length = os.path.getsize(arguments.output)
    wrote(arguments.output, f": {length:,} bytes")


def _report_quality(field: lfcore.LightField) -> None:
    slab, expected = field.require_slab(), field.content["expected"]
    near, far = expected["focus_m"]
    size = f"{slab.views} x {slab.views} views of {slab.size}"
    say(f"{size}: {expected['db']:g} dB expected, {near:g} to {far:g} m")
    note(expected_db=expected["db"], focus_range_m=[near, far])


COMMANDS = {"record": Command(DESCRIPTION, EPILOG, options, run)}
