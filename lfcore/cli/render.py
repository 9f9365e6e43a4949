"""``lfcore render``: pictures straight from a scene."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import lfcore
from lfcore.cli import film
from lfcore.cli import planes as plane_options
from lfcore.cli.command import Command, open_scene, refuse
from lfcore.cli.options import add, add_output, add_scene, check_form, flags, form, given
from lfcore.cli.progress import note, progress, say
from lfcore.errors import OpticsError
from lfcore.pictures import check_suffix

if TYPE_CHECKING:
    from lfcore.rendering.quality import Rendering

DESCRIPTION = """\
Trace a scene and make pictures from its rays at once, without storing a light field. SCENE is a
scene.yaml, a folder that holds one, a mesh (GLB, OBJ, PLY, STL, ...) or a .pbrt file."""
EPILOG = """\
examples:
  lfcore render model.glb -o picture.png --focus near
      any mesh: seen from the front left, with what is nearest in focus
  lfcore render model.glb -o picture.png --from right --focus-at 0.5,0.4 --blur 4%
      from the right, focused on a place of the picture, with twice the usual blur
  lfcore render scenes/bike -o bike.png --pixels 512
      8 x 8 lens samples by 2 x 2 rays per pixel, each spread by its depth
  lfcore render table.glb -o table.png --focus 2.5 --f-number 1.4
  lfcore render scenes/bike -o bike.png --quality-db 45
      with as few rays as that takes
  lfcore render scene.pbrt -o scene.exr
      as the file says: film, rays per pixel, lens or Camera "lightfield", shutter
  lfcore render scenes/bike -o pinhole.png --views 1 --filter nearest
      a pinhole: one ray per pixel, all in focus
  lfcore render scenes/bike -o bike.png --plane focus=2 --plane focus=6
      several pictures from the same rays
"""


def options(command: argparse.ArgumentParser) -> None:
    add_scene(command)
    add_output(command, "picture to write")
    add(
        command, "pixels",
        views="N x N lens samples (8, or 16 with --filter nearest)",
        subpixels="Q x Q rays per pixel and lens sample (2, or 1 with --filter nearest)",
        quality_db="as few rays as every picture needs for this PSNR against the average over its "
        "pixels and the lens", most_rays="",
    )  # fmt: skip
    command.add_argument(
        "--filter", choices=("depth", "nearest"), default="depth",
        help="spread each ray over what its part of lens and pixel covers at its depth "
        "(default), or count it in the pixel that it falls on",
    )  # fmt: skip
    command.add_argument(
        "--error-map", type=Path, metavar="FILE",
        help="with --quality-db: picture of each pixel's expected error, sRGB",
    )  # fmt: skip
    plane_options.add_options(command, of_file=False)
    film.add_options(command)


def run(arguments: argparse.Namespace) -> None:
    from lfcore.api import lattice_to_trace

    check_suffix(arguments.output)
    check_form(arguments, arguments.output)
    if arguments.error_map is not None:
        check_suffix(arguments.error_map)
    excluded = ["--filter nearest"] if arguments.filter == "nearest" else []
    quality = chosen_quality(
        arguments, "error_map", flags(arguments, "views", "subpixels") + excluded
    )
    scene = open_scene(arguments)
    if film.wanted(arguments, scene):
        film.render(arguments, scene)
        return
    pixels = arguments.pixels or 256
    planes = plane_options.read_planes(arguments, scene)
    plane_options.report(planes)
    same = {"planes": planes, "pixels": pixels, "device": arguments.device}
    lattice = with_subpixels(lattice_to_trace(arguments.filter, arguments.views), arguments)
    rays = 0 if quality else lattice.rays(pixels)
    with named_file(arguments.scene), progress("tracing", "parts", rays=rays) as report:
        if quality is None:
            same |= {"views": lattice, "filter": arguments.filter}
            pictures = lfcore.render(scene, progress=report, **same)
        else:
            made = lfcore.render_to_quality(scene, quality, progress=report, **same)
            pictures = made.pictures
    if quality:
        _report_quality(arguments, made, planes)
    plane_options.save(arguments.output, planes, pictures, form(arguments))


def _report_quality(arguments: argparse.Namespace, made: Rendering, planes: list) -> None:
    import numpy as np

    from lfcore.colour import srgb_decode

    db = ", ".join(f"{each:.1f}" for each in made.expected_db)
    traced = f"{made.rays_per_pixel:.0f} rays per pixel ({made.lattice})"
    say(f"{traced}: {db} dB expected")
    note(expected_db=list(map(float, made.expected_db)), rays_per_pixel=made.rays_per_pixel)
    if arguments.error_map is not None:
        shown = srgb_decode(np.repeat(made.error[..., None], 3, axis=-1))
        plane_options.save(arguments.error_map, planes, shown, {"bits": arguments.bits})


def chosen_quality(
    arguments: argparse.Namespace, other: str, excluded: Sequence[str], **more: Any
) -> lfcore.Quality | None:
    """The quality for which the rays are chosen, if any.

    Refuses the options ``excluded`` with it, and ``--most-rays`` and ``other`` without it.
    """
    if arguments.quality_db is None:
        if alone := flags(arguments, "most_rays", other):
            refuse("--quality-db", f"is what {alone[0]} belongs to", "Give it, too")
        return None
    if excluded:
        refuse("--quality-db", "chooses the rays itself", f"Leave out {', '.join(excluded)}")
    return lfcore.Quality(arguments.quality_db, **given(arguments, "most_rays"), **more)


def with_subpixels(lattice: lfcore.Lattice, arguments: argparse.Namespace) -> lfcore.Lattice:
    """The lattice with the rays per pixel of ``--subpixels``, if given."""
    return replace(lattice, **given(arguments, "subpixels"))


@contextmanager
def named_file(file: Path) -> Iterator[None]:
    """Errors of optics within the block name the file whose lens it is."""
    try:
        yield
    except OpticsError as error:
        raise error.named(OpticsError, file=error.file or file) from None


COMMANDS = {"render": Command(DESCRIPTION, EPILOG, options, run)}
