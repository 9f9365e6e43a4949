"""``lfcore render`` and ``record`` for cameras with their own film: pbrt's and ``lightfield``."""

import argparse

import numpy as np

import lfcore
from lfcore.cli.command import add, encoder, flags, form, refuse, write_named
from lfcore.cli.progress import progress, wrote
from lfcore.files import make_folder
from lfcore.pictures import check_suffix
from lfcore.scene.view import LIGHTFIELD, View

SLAB_OPTIONS = ("pixels", "views", "subpixels", "quality_db", "focus", "f_number", "plane",
                "lens", "aperture", "dual_pixel")  # fmt: skip
"""The options that select a picture from a light slab instead of the scene's own film."""
FILM_OPTIONS = ("samples", "white")
"""The options that only the scene's own film has."""


def add_options(command: argparse.ArgumentParser) -> None:
    text = "of a .pbrt file or a lightfield camera, unless asked otherwise"
    add(command.add_argument_group("the scene's own film", text), "samples")


def wanted(arguments: argparse.Namespace, scene: lfcore.Scene) -> bool:
    """Whether the scene's own film is exposed, instead of tracing a slab."""
    slab, film = flags(arguments, *SLAB_OPTIONS), flags(arguments, *FILM_OPTIONS)
    slab += ["--codec"] if "layout" in getattr(arguments, "codec", {}) else []
    if film and (slab or scene.view is None):
        problem = f"excludes {slab[0]}" if slab else "is for scenes with their own film"
        refuse(film[0], problem, "Leave it out, or use --views")
    return scene.view is not None and not slab


def is_array(scene: lfcore.Scene) -> bool:
    """Whether the film belongs to a light field camera."""
    return scene.view is not None and scene.view.kind == LIGHTFIELD


def render(arguments: argparse.Namespace, scene: lfcore.Scene) -> None:
    """Expose the film and write it; an EXR of a light field has its geometry in the header."""
    from lfcore.storage.tiled_exr import write_array

    (image, view), output = _expose(arguments, scene), arguments.output
    if not (is_array(scene) and output.suffix.lower() == ".exr"):
        write_named([(output, image)], **form(arguments))
        return
    make_folder(output.parent)
    extra = {"scene": scene.name, "shutter": list(view.shutter)}
    write_array(output, image, view.array, extra=extra)
    wrote(output)


def record(arguments: argparse.Namespace, scene: lfcore.Scene) -> None:
    """Expose a light field camera's film and store it as a light field file."""
    image, view = _expose(arguments, scene)
    save_video(arguments, image, view.array, scene=scene)


def save_video(
    arguments: argparse.Namespace,
    image: np.ndarray,
    array: lfcore.CameraArray,
    *,
    scene: lfcore.Scene | None = None,
    name: str | None = None,
) -> None:
    """Store an array with the encoder's options, and report its size and clipped pixels."""
    output = arguments.output
    check_suffix(output, (".mkv",))
    with progress("encoding", "cameras") as report:
        white = lfcore.LightField.from_views(
            image, array, output, encoding=encoder(arguments), scene=scene, name=name,
            white=arguments.white, progress=report,
        ).white  # fmt: skip
    clipped = float((image > white).any(-1).mean())
    facts = f": {array.cameras[0]} x {array.cameras[1]} cameras, "
    facts += f"{output.stat().st_size:,} bytes, white at {white:g}"
    wrote(output, facts + (f", {100 * clipped:.2g} % of the pixels clipped" if clipped else ""))


def _expose(arguments: argparse.Namespace, scene: lfcore.Scene) -> tuple[np.ndarray, View]:
    assert scene.view is not None  # of wanted()
    width, height = scene.view.film
    samples, instants = arguments.samples or (None, None)
    samples = samples or scene.view.samples_per_pixel
    label = f"tracing {width} x {height} pixels, {samples} rays each"
    with progress(label, rays=width * height * samples) as report:
        image = lfcore.trace_array(
            scene, samples_per_pixel=samples, instants=instants, device=arguments.device,
            progress=report,
        )  # fmt: skip
    return image, scene.view
