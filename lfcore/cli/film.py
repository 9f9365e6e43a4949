"""``lfcore render`` and ``trace`` of a scene whose camera has a film of its own: pbrt's, and
``lightfield``."""

from __future__ import annotations

import argparse

import numpy as np

import lfcore
from lfcore.cli.command import encoder, option, refuse
from lfcore.cli.progress import progress, wrote
from lfcore.files import make_folder
from lfcore.pictures import check_suffix, write_picture
from lfcore.scene.view import LIGHTFIELD, View

# Options that ask for a square picture from a light slab instead of the scene's own film.
SLAB_OPTIONS = (
    "size", "views", "subpixels", "quality", "pinhole", "focus", "f_number", "plane", "planes",
    "layout", "pixel_format",
)  # fmt: skip
FILM_OPTIONS = ("samples", "instants", "white")


def add_options(command: argparse.ArgumentParser) -> None:
    own = command.add_argument_group(
        "the scene's own film", "of a .pbrt file or a lightfield camera, unless asked otherwise"
    )
    own.add_argument("--samples", type=int, metavar="S", help="rays a pixel (the scene's)")
    own.add_argument(
        "--instants", type=int, metavar="T",
        help="of the shutter while objects move (up to 16 of the rays)",
    )  # fmt: skip


def wanted(arguments: argparse.Namespace, scene: lfcore.Scene) -> bool:
    """Whether the scene's own film is to be exposed, not a slab traced.

    Raises :class:`OpticsError` for options of the film where there is none, or of both.
    """
    slab, film = (
        [name for name in names if _given(getattr(arguments, name, None))]
        for names in (SLAB_OPTIONS, FILM_OPTIONS)
    )
    if film and (slab or scene.view is None):
        what = f"excludes {option(slab[0])}" if slab else "belongs to a scene with a film"
        refuse(option(film[0]), what, "Leave it out, or use --views")
    for name in film:
        if name != "white" and getattr(arguments, name) < 1:
            refuse(option(name), "must be at least 1")
    return scene.view is not None and not slab


def is_array(scene: lfcore.Scene) -> bool:
    """Whether the film is a light field camera's."""
    return scene.view is not None and scene.view.kind == LIGHTFIELD


def render(arguments: argparse.Namespace, scene: lfcore.Scene) -> None:
    """Expose the film and write it; a light field to an EXR with its geometry in the header."""
    from lfcore.storage.tiled_exr import write_array

    (image, view), output = _expose(arguments, scene), arguments.output
    if view.kind == LIGHTFIELD and output.suffix.lower() == ".exr":
        make_folder(output.parent)
        extra = {"scene": scene.name, "shutter": list(view.shutter)}
        write_array(output, image, view.array, extra=extra)
    else:
        write_picture(output, image, bits=arguments.bits)
    wrote(output)


def trace(arguments: argparse.Namespace, scene: lfcore.Scene) -> None:
    """Expose a light field camera's film and store it as a light field file."""
    from lfcore.scene.files import scene_digest

    what = {"name": scene.name, "digest": scene_digest(scene)}
    image, view = _expose(arguments, scene)
    said = save_video(arguments, image, view.array, what)
    wrote(arguments.output, said.removeprefix(str(arguments.output)))


def save_video(
    arguments: argparse.Namespace,
    image: np.ndarray,
    array: lfcore.CameraArray,
    scene: dict[str, str],
) -> str:
    """Store an array as the options on the encoder say; returns one line about it."""
    from lfcore.storage.defaults import codec_spec

    output = arguments.output
    check_suffix(output, (".mkv",))
    spec = codec_spec(array.cameras[0], **encoder(arguments))
    with progress("encoding", "cameras") as report:
        white = lfcore.store_array(
            output, image, array, spec, scene=scene, white=arguments.white, progress=report
        ).white
    clipped = float((image > white).any(-1).mean())
    said = f"{output}: {array.cameras[0]} x {array.cameras[1]} cameras, "
    said += f"{output.stat().st_size:,} bytes, white at {white:g}"
    return said + (f", {100 * clipped:.2g} % of the pixels clipped" if clipped else "")


def _expose(arguments: argparse.Namespace, scene: lfcore.Scene) -> tuple[np.ndarray, View]:
    assert scene.view is not None  # of wanted()
    width, height = scene.view.film
    samples = arguments.samples or scene.view.samples_per_pixel
    what = f"tracing {width} x {height} pixels, {samples} rays each"
    with progress(what, rays=width * height * samples) as report:
        image = lfcore.trace_array(
            scene, samples_per_pixel=samples, instants=arguments.instants,
            device=arguments.device, progress=report,
        )  # fmt: skip
    return image, scene.view


def _given(value: object) -> bool:
    # 0 was given, if wrongly.
    return value is not None and value is not False and value != []
