"""``lfcore depth``."""

import argparse
import math
from functools import partial
from pathlib import Path

import numpy as np

import lfcore
from lfcore.cli.command import (
    Command,
    add,
    add_output,
    add_scene,
    flags,
    open_scene,
    refuse,
    write_named,
)
from lfcore.cli.progress import progress, wrote
from lfcore.pictures import CODED, check_suffix

DESCRIPTION = """\
Trace depth (metres along the axis) and disparity (pixels between neighbouring views) of a scene's
views, exact and without anti-aliasing. Without a scene, write the depth of a light field file. Or
make a picture with everything in focus."""
EPILOG = """\
examples:
  lfcore depth example --lightfield bike.mkv -o bike_depth.npz
      depth_m and disparity_px, (views, rows, columns), of the light field's views
  lfcore depth example --pixels 512 -o centre.png
      the middle view as a picture: near is warm, far is cold
  lfcore depth example --views 9 --view 0 4 --truth left.exr
  lfcore depth bike.mkv --all-in-focus sharp.png
"""


def options(command: argparse.ArgumentParser) -> None:
    usual = "scene.yaml, its folder, a mesh, a .pbrt file, or a light field that holds depth"
    add_scene(command, help=usual, nargs="?")
    add_output(command, ".npz (every view); .pfm, .exr, or .png to look at (one view)",
               required=False)  # fmt: skip
    view = "lens column and row, for output of one view (the middle)"
    add(command, "pixels", views="N x N views (1)", view=view)
    more = command.add_argument
    more("--all-in-focus", type=Path, metavar="PICTURE", help="all-in-focus picture to write")
    more(
        "--truth",
        type=Path,
        metavar="FILE",
        help="of one view, .npz or .exr: normals, albedo, "
        "numbers of materials and triangles, specular pixels and the depth of images in them, and "
        "flow to the middle view and occlusion there",
    )
    more("--lightfield", metavar="FILE", help="light field file or URL with the lens and views")
    more("--format", choices=("depth", "disparity"), default="depth",
         help="of one view: depth (default), or disparity in .pfm or .exr")  # fmt: skip
    more("--depth", choices=("surface", "virtual"), default="surface",
         help="of surfaces (default), or of what mirrors, glass and coats show")  # fmt: skip


def run(arguments: argparse.Namespace) -> None:
    from lfcore.optics.slab import Slab
    from lfcore.rendering import depth as depths
    from lfcore.rendering.prepared import open_dark_tracer

    field = _checked(arguments)
    scene = open_scene(arguments) if arguments.scene else None
    virtual = arguments.depth == "virtual"
    if field:
        slab = field.made_views
        depth_of = partial(field.depth, scene, device=arguments.device, virtual=virtual)
    else:
        assert scene  # checked above
        slab = Slab.of(scene.camera, arguments.views or 1, arguments.pixels or 256)
        tracer = open_dark_tracer(scene, arguments.device)
        depth_of = partial(depths.depth_of_views, tracer, slab, virtual=virtual)
    if arguments.output:
        samples = depths.all_samples(slab)
        suffix = arguments.output.suffix.lower()
        if suffix != ".npz":
            middle = slab.views // 2
            samples = np.array([arguments.view or (middle, middle)])
        rays = len(samples) * math.prod(slab.size)
        with progress("tracing depth" if scene else "reading depth", rays=rays) as report:
            depth = depth_of(samples=samples, progress=report)
        if suffix == ".npz":
            depths.save_depth(arguments.output, slab, samples, depth)
            wrote(arguments.output)
        elif suffix in CODED:
            write_named([(arguments.output, depths.depth_picture(depth[0]))])
        else:
            picture = depths.disparity(slab, depth) if arguments.format == "disparity" else depth
            write_named([(arguments.output, picture[0])])
    if arguments.truth:
        from lfcore.rendering.truth import view_truth

        assert scene  # checked above
        centre = (slab.views // 2,) * 2
        tracer = open_dark_tracer(scene, arguments.device)
        known = view_truth(tracer, slab, arguments.view or centre, centre)
        lfcore.write_truth(arguments.truth, known)
        wrote(arguments.truth)
    if field and arguments.all_in_focus:
        with progress("bringing everything into focus", "views") as report:
            sharp = field.all_in_focus(scene, device=arguments.device, progress=report)
        write_named([(arguments.all_in_focus, sharp)])


def _checked(arguments: argparse.Namespace) -> lfcore.LightField | None:
    """The light field, if one is named; raises :class:`LfcoreError` for missing options."""
    if not arguments.lightfield and str(arguments.scene).lower().endswith(".mkv"):
        arguments.scene, arguments.lightfield = None, str(arguments.scene)
    if not (arguments.output or arguments.all_in_focus or arguments.truth):
        refuse("--output", "nothing to write", "Give --output, --truth or --all-in-focus")
    if arguments.truth:
        check_suffix(arguments.truth, (".npz", ".exr"), key="--truth")
        if not arguments.scene:
            refuse("--truth", "needs a scene, since a file holds no normals", "Give it, too")
    if arguments.output:
        check_suffix(arguments.output, (".npz", ".pfm", ".exr", *CODED))
        if arguments.format == "disparity" and arguments.output.suffix not in (".pfm", ".exr"):
            refuse("--format", "disparity needs numbers", "Write a .pfm or .exr, or both in .npz")
    if not (arguments.scene or arguments.lightfield):
        refuse("scene", "is missing", "Give a scene, or a light field with depth by --lightfield")
    if arguments.lightfield and (wrong := flags(arguments, "views", "pixels")):
        refuse(wrong[0], "excludes --lightfield, whose views are used", "Leave one out")
    if arguments.all_in_focus:
        check_suffix(arguments.all_in_focus, key="--all-in-focus")
        if not arguments.lightfield:
            refuse("--all-in-focus", "needs the colours of a light field", "Give --lightfield")
    if not arguments.lightfield:
        return None
    field = lfcore.LightField.open(arguments.lightfield)
    field.require_slab()
    return field


COMMANDS = {"depth": Command(DESCRIPTION, EPILOG, options, run)}
