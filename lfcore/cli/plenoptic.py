"""``lfcore plenoptic``."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.cli import planes as plane_options
from lfcore.cli import values
from lfcore.cli.command import Command, add, add_output, add_scene, open_scene, refuse, write_named
from lfcore.cli.progress import progress, say
from lfcore.pictures import check_suffix

DESCRIPTION = """\
Trace a scene through a plenoptic camera: M x M microlenses in the image of a main lens, N x N
photosensor pixels behind each. The photograph has M N x M N pixels; sub-aperture views and
refocused pictures of M x M can be made from it."""
EPILOG = """\
examples:
  lfcore plenoptic example -o photograph.png --pixels 512 --views 16 --focus 2.5
      8192 x 8192 pixels, the plants in front in focus
  lfcore plenoptic example -o photograph.png --pixels 128 --views 8 --refocus 2.5 near.png
  lfcore plenoptic example -o photograph.png --view 0 0 corner.png
"""


def options(command: argparse.ArgumentParser) -> None:
    add_scene(command)
    add_output(command, "the photograph")
    add(
        command,
        pixels="M x M microlenses (128)",
        views="N x N photosensor pixels behind each microlens (16)",
    )  # fmt: skip
    plane_options.add_focus(command, of_file=False)
    repeat: dict[str, Any] = {"action": "append", "default": []}
    command.add_argument("--refocus", nargs=2, metavar=("METRES", "PICTURE"), **repeat,
                         help="refocus digitally; repeat for more")  # fmt: skip
    command.add_argument("--view", nargs=3, metavar=("I", "J", "PICTURE"), **repeat,
                         help="extract a sub-aperture view; repeat for more")  # fmt: skip


def run(arguments: argparse.Namespace) -> None:
    from lfcore.optics.planes import SensorPlane
    from lfcore.optics.plenoptic import PlenopticCamera, sub_aperture
    from lfcore.rendering.defaults import recorded_lens
    from lfcore.rendering.plenoptic import photograph, refocus_photograph
    from lfcore.rendering.prepared import open_tracer

    samples = arguments.views or 16
    refocus = [
        (_read("--refocus", values.distance, metres), _picture(path))
        for metres, path in arguments.refocus
    ]
    index = values.count(0, samples - 1)
    views = [
        (_read("--view", index, i), _read("--view", index, j), _picture(path))
        for i, j, path in arguments.view
    ]
    check_suffix(arguments.output)
    scene = open_scene(arguments)
    scene, lens, fitted = recorded_lens(scene, 1, **plane_options.of_scene(arguments))
    for part, note in fitted.items():
        say(f"{part} {note}")
    camera = PlenopticCamera(lens, arguments.pixels or 128, samples)
    planes = [SensorPlane(metres, lens.f_number) for metres, _ in refocus]
    for plane in planes:
        plane.check(camera.slab())
    side = camera.photograph_side
    say(
        f"{camera.lenses} x {camera.lenses} microlenses of {1e6 * camera.pitch_m:.4g} um, focal "
        f"length {1e3 * camera.microlens_focal_length_m:.4g} mm, hyperfocal distance "
        f"{1e3 * camera.hyperfocal_distance_m:.4g} mm; main lens at "
        f"{1e3 * lens.image_distance_m:.4g} mm"
    )
    with progress(f"tracing a photograph of {side} x {side}", "microlenses") as report:
        tracer = open_tracer(scene, arguments.device, report)
        picture = photograph(tracer, camera, progress=report)
    named = [(arguments.output, picture)]
    for i, j, path in views:
        named.append((path, np.ascontiguousarray(sub_aperture(picture, samples, i, j))))
    if planes:
        refocused = refocus_photograph(camera, picture, planes, device=tracer.device)
        named += [(path, each) for (_, path), each in zip(refocus, refocused, strict=True)]
    write_named(named)


def _read(flag: str, read: Callable[[str], Any], text: str) -> Any:
    """Check one of a flag's values: argparse checks only flags whose values have one kind."""
    try:
        return read(text)
    except argparse.ArgumentTypeError as error:
        refuse(flag, str(error))


def _picture(text: str) -> Path:
    check_suffix(Path(text), key="--refocus or --view")
    return Path(text)


COMMANDS = {"plenoptic": Command(DESCRIPTION, EPILOG, options, run)}
