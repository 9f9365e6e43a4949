"""``lfcore render`` and ``trace`` of a scene whose camera has a film of its own: pbrt's, and
``lightfield``."""

from __future__ import annotations

import argparse

from lfcore.cli.progress import progress, say
from lfcore.errors import OpticsError
from lfcore.files import make_folder
from lfcore.pictures import write_picture

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


def wants_film(arguments: argparse.Namespace, scene) -> bool:
    """Whether the scene's own film is to be exposed, not a slab traced.

    Raises :class:`OpticsError` for options of the film where there is none, or of both.
    """
    slab, film = (
        [name for name in names if _given(getattr(arguments, name, None))]
        for names in (SLAB_OPTIONS, FILM_OPTIONS)
    )
    if film and (slab or scene.view is None):
        what = f"excludes {_option(slab[0])}" if slab else "belongs to a scene with a film"
        raise OpticsError(what, key=_option(film[0]), remedy="Leave it out, or use --views")
    for name in film:
        if name != "white" and getattr(arguments, name) < 1:
            raise OpticsError("must be at least 1", key=_option(name))
    return scene.view is not None and not slab


def render_film(arguments: argparse.Namespace, scene) -> None:
    """Expose the film and write it; a light field to an EXR with its geometry in the header."""
    from lfcore.scene.view import LIGHTFIELD
    from lfcore.storage.tiled_exr import write_array

    image, view, output = _expose(arguments, scene), scene.view, arguments.output
    if view.kind == LIGHTFIELD and output.suffix.lower() == ".exr":
        make_folder(output.parent)
        extra = {"scene": scene.name, "shutter": list(view.shutter)}
        write_array(output, image, view.array, extra=extra)
    else:
        write_picture(output, image, bits=getattr(arguments, "bits", 8))
    say(f"wrote {output}")


def trace_film(arguments: argparse.Namespace, scene) -> None:
    """Expose a light field camera's film and store it as a light field file."""
    from lfcore.cli.imgtool_store import save_video
    from lfcore.scene.files import scene_digest

    what = {"name": scene.name, "digest": scene_digest(scene)}
    say(f"wrote {save_video(arguments, _expose(arguments, scene), scene.view.array, what)}")


def _expose(arguments: argparse.Namespace, scene):
    from lfcore.api import trace_array

    width, height = scene.view.film
    samples = arguments.samples or scene.view.samples_per_pixel
    with progress(f"tracing {width} x {height} pixels, {samples} rays each", "instants") as report:
        return trace_array(
            scene, samples_per_pixel=samples, instants=arguments.instants,
            device=arguments.device, progress=report,
        )  # fmt: skip


def _given(value) -> bool:
    # 0 was given, if wrongly.
    return value is not None and value is not False and value != []


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"
