"""``lfcore plenoptic``."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from lfcore.cli.command import Command, open_scene, refuse, write_named
from lfcore.cli.options import add_lens, add_output, add_scene, distance
from lfcore.cli.progress import progress, say
from lfcore.pictures import check_suffix

DESCRIPTION = """\
Trace a scene through a plenoptic camera: microlenses in the image of a main lens, N x N
photosensor pixels behind each. The photograph has M N x M N pixels; sub-aperture views and
refocused pictures of M x M can be made from it."""
EPILOG = """\
examples:
  lfcore plenoptic scenes/chart -o photograph.png --lenses 512 --samples 16 --focus 2
      8192 x 8192 pixels, the background in focus
  lfcore plenoptic scenes/chart -o photograph.png --lenses 128 --samples 8 --refocus 1 near.png
  lfcore plenoptic scenes/chart -o photograph.png --view 0 0 corner.png
"""


def options(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    add_scene(command)
    add_output(command, "the photograph")
    add("--lenses", type=int, default=128, metavar="M", help="M x M microlenses (128)")
    add("--samples", type=int, default=16, metavar="N", help="N x N pixels behind each (16)")
    add_lens(command, "of the main lens, metres, or 'inf'", "of the main lens")
    add("--refocus", nargs=2, action="append", default=[], metavar=("M", "PICTURE"),
        help="refocus digitally; again for more")  # fmt: skip
    add("--view", nargs=3, action="append", default=[], metavar=("I", "J", "PICTURE"),
        help="extract a sub-aperture view; again for more")  # fmt: skip


def run(arguments: argparse.Namespace) -> None:
    from lfcore.api import recorded_camera
    from lfcore.optics.planes import SensorPlane
    from lfcore.optics.plenoptic import PlenopticCamera, sub_aperture
    from lfcore.rendering.plenoptic import photograph, refocus_photograph
    from lfcore.rendering.prepared import open_tracer

    refocus, views = _requests(arguments)
    scene = open_scene(arguments)
    lens = recorded_camera(scene.camera, arguments.focus, arguments.f_number)
    camera = PlenopticCamera(lens, arguments.lenses, arguments.samples)
    planes = [SensorPlane(metres, lens.f_number) for metres, _ in refocus]
    for plane in planes:
        plane.check(camera.slab())
    tracer = open_tracer(scene, arguments.device)
    side = camera.photograph_side
    say(
        f"{camera.lenses} x {camera.lenses} microlenses of {1e6 * camera.pitch_m:.4g} um, focal "
        f"length {1e3 * camera.microlens_focal_length_m:.4g} mm, hyperfocal distance "
        f"{1e3 * camera.hyperfocal_distance_m:.4g} mm; main lens at "
        f"{1e3 * lens.image_distance_m:.4g} mm"
    )
    with progress(f"tracing a photograph of {side} x {side}", "microlenses") as report:
        picture = photograph(tracer, camera, progress=report)
    named = [(arguments.output, picture)]
    for i, j, path in views:
        named.append((path, np.ascontiguousarray(sub_aperture(picture, camera.samples, i, j))))
    if planes:
        made = refocus_photograph(camera, picture, planes, device=tracer.device)
        named += [(path, one) for (_, path), one in zip(refocus, made, strict=True)]
    write_named(named)


def _requests(
    arguments: argparse.Namespace,
) -> tuple[list[tuple[float, Path]], list[tuple[int, int, Path]]]:
    """(metres, path) of --refocus and (i, j, path) of --view, checked before any work."""
    check_suffix(arguments.output)
    refocus, views = [], []
    for text, path in arguments.refocus:
        try:
            refocus.append((distance(text), Path(path)))
        except argparse.ArgumentTypeError as error:
            refuse("--refocus", str(error))
    for i, j, path in arguments.view:
        if not (i.isdigit() and j.isdigit() and max(int(i), int(j)) < arguments.samples):
            refuse("--view", f"pixels are from 0 to {arguments.samples - 1}, not ({i}, {j})")
        views.append((int(i), int(j), Path(path)))
    for path in (*(p for _, p in refocus), *(p for *_, p in views)):
        check_suffix(path, key="--refocus or --view")
    return refocus, views


COMMANDS = {"plenoptic": Command(DESCRIPTION, EPILOG, options, run)}
