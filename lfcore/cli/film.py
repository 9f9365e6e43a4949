"""``lfcore render`` and ``trace`` of a scene whose camera has a film of its own: pbrt's, and
``lightfield``."""

from __future__ import annotations

import argparse

import numpy as np

import lfcore
from lfcore.cli.command import asked, encoder, refuse, write_named
from lfcore.cli.progress import progress, wrote
from lfcore.files import make_folder
from lfcore.pictures import check_suffix
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
    slab, film = asked(arguments, SLAB_OPTIONS), asked(arguments, FILM_OPTIONS)
    if film and (slab or scene.view is None):
        what = f"excludes {slab[0]}" if slab else "belongs to a scene with a film"
        refuse(film[0], what, "Leave it out, or use --views")
    for key, count in ("--samples", arguments.samples), ("--instants", arguments.instants):
        if count is not None and count < 1:
            refuse(key, "must be at least 1")
    return scene.view is not None and not slab


def is_array(scene: lfcore.Scene) -> bool:
    """Whether the film is a light field camera's."""
    return scene.view is not None and scene.view.kind == LIGHTFIELD


def render(arguments: argparse.Namespace, scene: lfcore.Scene) -> None:
    """Expose the film and write it; a light field to an EXR with its geometry in the header."""
    from lfcore.storage.tiled_exr import write_array

    (image, view), output = _expose(arguments, scene), arguments.output
    if not (is_array(scene) and output.suffix.lower() == ".exr"):
        write_named([(output, image)], bits=arguments.bits)
        return
    make_folder(output.parent)
    extra = {"scene": scene.name, "shutter": list(view.shutter)}
    write_array(output, image, view.array, extra=extra)
    wrote(output)


def trace(arguments: argparse.Namespace, scene: lfcore.Scene) -> None:
    """Expose a light field camera's film and store it as a light field file."""
    from lfcore.scene.files import scene_digest

    what = {"name": scene.name, "digest": scene_digest(scene)}
    image, view = _expose(arguments, scene)
    wrote(arguments.output, save_video(arguments, image, view.array, what))


def save_video(
    arguments: argparse.Namespace,
    image: np.ndarray,
    array: lfcore.CameraArray,
    scene: dict[str, str],
) -> str:
    """Store an array as the options on the encoder say; returns what there is to say of it."""
    from lfcore.storage.defaults import chosen_encoding

    output = arguments.output
    check_suffix(output, (".mkv",))
    spec = chosen_encoding(array.cameras[0], encoder(arguments))
    with progress("encoding", "cameras") as report:
        white = lfcore.store_array(
            output, image, array, spec, scene=scene, white=arguments.white, progress=report
        ).white
    clipped = float((image > white).any(-1).mean())
    said = f": {array.cameras[0]} x {array.cameras[1]} cameras, "
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
