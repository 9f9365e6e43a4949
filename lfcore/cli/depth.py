"""``lfcore depth``."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import lfcore
from lfcore.cli.command import Command, open_scene, refuse, write_named
from lfcore.cli.options import add_scene
from lfcore.cli.progress import progress, wrote
from lfcore.pictures import CODED, check_suffix

DESCRIPTION = """\
Depth (metres along the axis) and disparity (pixels from view to view) of every view of a scene,
exact and without anti-aliasing; and a picture in which everything is in focus."""
EPILOG = """\
examples:
  lfcore depth scenes/bike --lightfield bike.mkv -o bike_depth.npz
      depth_m and disparity_px, (views, rows, columns), of the light field that was traced
  lfcore depth scenes/bike --size 512 -o centre.pfm
      of the view through the middle of the lens alone, as a float map
  lfcore depth scenes/bike --size 512 -o centre.png
      the same to look at: near is warm, far is cold
  lfcore depth scenes/bike --lightfield bike.mkv --all-in-focus sharp.png
"""


def options(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    add_scene(command)
    add("-o", "--output", type=Path,
        help=".npz (every view); .pfm, .exr, or .png to look at (one view)")  # fmt: skip
    add("--all-in-focus", type=Path, metavar="PICTURE", help="picture to write")
    add("--lightfield", metavar="FILE", help="or its URL: whose lens, size and views to use")
    add("--size", type=int, default=256, metavar="M", help="M x M pixels (256)")
    add("--views", type=int, default=1, metavar="N", help="N x N views (1)")
    add("--view", nargs=2, type=int, metavar=("I", "J"), help="which, of one view")
    add("--disparity", action="store_true", help="disparity instead of depth")


def run(arguments: argparse.Namespace) -> None:
    from lfcore.optics.slab import Slab
    from lfcore.rendering import depth as depths
    from lfcore.rendering.prepared import open_tracer

    field = _checked(arguments)
    scene = open_scene(arguments)
    slab = field.require_slab() if field else Slab(scene.camera, arguments.views, arguments.size)
    if arguments.output:
        samples = depths.all_samples(slab)
        suffix = arguments.output.suffix.lower()
        if suffix != ".npz":
            middle = slab.views // 2
            samples = np.array([arguments.view or (middle, middle)])
        tracer = open_tracer(scene, arguments.device)
        rays = len(samples) * slab.pixels**2
        with progress(f"tracing the depth of {len(samples)} views", rays=rays) as report:
            depth = depths.depth_of_views(tracer, slab, samples, progress=report)
        if suffix == ".npz":
            depths.save_depth(arguments.output, slab, samples, depth)
            wrote(arguments.output)
        elif suffix in CODED:
            write_named([(arguments.output, depths.depth_picture(depth[0]))])
        else:
            picture = depths.disparity(slab, depth) if arguments.disparity else depth
            write_named([(arguments.output, picture[0])])
    if field and arguments.all_in_focus:
        with progress("bringing everything into focus", "views") as report:
            sharp = field.all_in_focus(scene, device=arguments.device, progress=report)
        write_named([(arguments.all_in_focus, sharp)])


def _checked(arguments: argparse.Namespace) -> lfcore.LightField | None:
    """The light field that is named, if any; :class:`LfcoreError` for options that miss others."""
    if not (arguments.output or arguments.all_in_focus):
        refuse("--output", "nothing to write", "Give --output or --all-in-focus")
    if arguments.output:
        check_suffix(arguments.output, (".npz", ".pfm", ".exr", *CODED))
    if arguments.all_in_focus:
        check_suffix(arguments.all_in_focus, key="--all-in-focus")
        if not arguments.lightfield:
            refuse("--all-in-focus", "needs the colours of a light field", "Give --lightfield")
    if not arguments.lightfield:
        return None
    field = lfcore.LightField.open(arguments.lightfield)
    field.require_slab()
    return field


COMMANDS = {"depth": Command(DESCRIPTION, EPILOG, options, run, programs=True)}
