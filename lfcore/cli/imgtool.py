"""``lfcore imgtool``: camera arrays between tiled EXR and video, and pictures from them.

It accepts the assignment's command lines of all years: the Isaksen filter of 2016-2018
(``--filterwidth``, ``--focalplanez``) and the Monte Carlo thin lens of 2019-2022
(``--focaldistance``, ``--camerarot``).  All coordinates are pbrt's: x right, y up, z forward, the
data cameras in z = 0.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import lfcore
from lfcore.cli import values
from lfcore.cli.command import Command, add_encoder, flags, given, refuse
from lfcore.cli.command import add as add_option
from lfcore.cli.film import save_video
from lfcore.cli.progress import progress, wrote
from lfcore.colour import tonemap
from lfcore.errors import OpticsError
from lfcore.optics.array import CameraArray
from lfcore.pictures import ALL_CODED, check_suffix, write_picture

if TYPE_CHECKING:
    from lfcore.refocus.array.device_field import DeviceField, Synthesis
    from lfcore.refocus.array.focal_surface import FocalSurface
    from lfcore.refocus.array.virtual_camera import VirtualCamera

VIDEO = ".mkv"


def add_files(command: argparse.ArgumentParser, input: str, output: str) -> None:
    """Add the input file, and the output file: last as for pbrt's tool, or after ``-o``."""
    command.add_argument("input", type=Path, help=input)
    command.add_argument("last", type=Path, nargs="?", metavar="output", help="the same as -o")
    command.add_argument("-o", "--output", type=Path, help=f"{output} to write")


def output(arguments: argparse.Namespace) -> Path:
    """The file to write; raises :class:`OpticsError` for none or two."""
    if (arguments.output is None) == (arguments.last is None):
        refuse("--output", "needs one file to write", "Give -o FILE")
    return arguments.output or arguments.last


def add_bits(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--bits", type=int, choices=(16, 32), default=32, help="bits per sample of the EXR (32)"
    )


def add_geometry(command: argparse.ArgumentParser) -> None:
    add = command.add_argument_group("the light field (default: by its header)").add_argument
    add("--camsperdim", nargs=2, type=values.count(), metavar=("X", "Y"), help="cameras (1 1)")
    add("--griddim", nargs=4, type=values.number(), metavar=("XMIN", "XMAX", "YMIN", "YMAX"),
        help="bounding box of the data cameras, metres (0 0 0 0)")  # fmt: skip
    add("--inputfov", type=values.angle, metavar="DEG", help="field of view of data cameras (90)")
    add("--spacing", choices=("ends", "cells"),
        help="outermost cameras on the bounds, or all in the middle of cells (ends)")  # fmt: skip


def geometry(
    arguments: argparse.Namespace, recorded: CameraArray | None, shape: tuple[int, ...]
) -> CameraArray:
    """The array by the header or by flags, which must agree."""
    flags = given(arguments, "camsperdim", "griddim", "inputfov", "spacing")
    if recorded is not None:
        _check_agreement(flags, recorded, arguments.input)
        return recorded
    (width, height), cameras = shape[1::-1], flags.get("camsperdim", (1, 1))
    if width % cameras[0] or height % cameras[1]:
        problem = f"{cameras[0]} x {cameras[1]} cameras do not divide {width} x {height} pixels"
        remedy = "Give the number of cameras that the light field was made with"
        raise OpticsError(problem, file=arguments.input, key="--camsperdim", remedy=remedy)
    return CameraArray.on_grid(
        cameras, flags.get("griddim", (0.0, 0.0, 0.0, 0.0)), flags.get("inputfov", 90.0),
        (width // cameras[0], height // cameras[1]), flags.get("spacing", "ends"),
    )  # fmt: skip


def _check_agreement(flags: dict[str, Any], recorded: CameraArray, file: Path) -> None:
    low_x, high_x, low_y, high_y = recorded.bounds()
    facts: dict[str, Any] = {
        "camsperdim": recorded.cameras, "griddim": (low_x, high_x, -high_y, -low_y),
        "inputfov": recorded.fov_deg, "spacing": "cells" if any(recorded.margin_m) else "ends",
    }  # fmt: skip
    for name, value in flags.items():
        fact = facts[name]
        same = value == fact if name == "spacing" else np.allclose(value, fact, 1e-5, 1e-9)
        if not same:
            problem = f"contradicts the header, which says {fact}"
            raise OpticsError(problem, file=file, key=f"--{name}", remedy="Leave the flag out")


def read_lightfield(path: Path) -> tuple[np.ndarray, CameraArray | None, dict[str, Any]]:
    """Read picture, geometry if known, and other metadata of an EXR or a video."""
    if path.suffix.lower() != VIDEO:
        from lfcore.storage.tiled_exr import read_array

        tiled = read_array(path)
        return tiled.image, tiled.array, tiled.extra
    from lfcore.refocus.stored_views import read_stored
    from lfcore.storage.lightfield import LightFieldFile

    field = LightFieldFile.open(path)
    with progress("reading views", "frames") as report:
        image, array = read_stored(field, progress=report)
    return image, array, {"scene": field.metadata.scene["name"]}


def store(arguments: argparse.Namespace) -> None:
    """EXR to video."""
    check_suffix(arguments.input, (".exr",), "input")
    arguments.output = output(arguments)
    image, recorded, extra = read_lightfield(arguments.input)
    array = geometry(arguments, recorded, image.shape)
    name = str(extra.get("scene", arguments.input.stem))
    save_video(arguments, image, array, name=name)


def tiles(arguments: argparse.Namespace) -> None:
    """Video to EXR, with the geometry in its header."""
    from lfcore.storage.tiled_exr import write_array

    path = output(arguments)
    check_suffix(arguments.input, (VIDEO,), "input")
    check_suffix(path, (".exr",), "output")
    image, array, extra = read_lightfield(arguments.input)
    assert array is not None  # every video has one
    write_array(path, image, array, half=arguments.bits == 16, extra=extra)
    wrote(path, f": {array.cameras[0]} x {array.cameras[1]} tiles of {array.tile}")


def convert(arguments: argparse.Namespace) -> None:
    """Write a linear EXR as an 8-bit sRGB picture."""
    from lfcore.exr import read_exr_picture

    path = output(arguments)
    check_suffix(path, ALL_CODED, "output")
    image = np.nan_to_num(read_exr_picture(arguments.input).astype(np.float64)) * arguments.scale
    write_picture(path, tonemap(image) if arguments.tonemap else image)
    wrote(path, f": {image.shape[1]} x {image.shape[0]}")


def _convert_options(command: argparse.ArgumentParser) -> None:
    add_files(command, "EXR to read", "picture")
    more = command.add_argument
    more("--tonemap", action="store_true",
         help="Reinhard's global operator on luminance, scaled by the brightest pixel")  # fmt: skip
    more("--scale", type=values.number(), default=1.0, metavar="X", help="multiply radiance first")


def _store_options(command: argparse.ArgumentParser) -> None:
    add_files(command, "EXR that holds all data cameras", "light field file (.mkv)")
    add_geometry(command)
    add_option(add_encoder(command), "white")


def _tiles_options(command: argparse.ArgumentParser) -> None:
    add_files(command, "light field file (.mkv): array or slab", "EXR with all views side by side")
    add_bits(command)


def _tool(
    text: str, options: Callable[..., None], run: Callable[[argparse.Namespace], None]
) -> tuple[Command, str]:
    return Command(f"{text[0].upper()}{text[1:]}.", "", options, run), text


QUADRATURE = "quadrature"
DESCRIPTION = "Make pictures from a camera array's light field, or convert EXR pictures."
LIGHTFIELD = """\
Synthesise a picture from a camera array: by Isaksen's filter, or through a thin lens with one of
--montecarlo, --sampler, --focaldistance and --camerarot, or through a realistic one with --lens.
Geometry in the EXR's header makes --camsperdim, --griddim and --inputfov optional."""
LIGHTFIELD_EXAMPLES = """\
examples:
  lfcore imgtool lightfield --focalplanez 6.8 --filterwidth 0.3 array.exr near.exr
  lfcore imgtool lightfield --montecarlo --lensradius 0.1 --samplesperpixel 64 array.exr near.exr
  lfcore imgtool lightfield --focalsurface sphere:0,0,5,2 --filterwidth 0.3 array.exr -o ball.exr
"""


def options(command: argparse.ArgumentParser) -> None:
    tools = command.add_subparsers(dest="tool", required=True, metavar="TOOL")
    for name, (tool, summary) in TOOLS.items():
        tool.add_to(tools, name, summary)


def _lightfield_options(command: argparse.ArgumentParser) -> None:
    add_files(command, "EXR of all data cameras, or a light field file (.mkv)", "EXR")
    add_geometry(command)
    add = command.add_argument
    add("--camerapos", nargs=3, type=values.number(), default=(0.0, 0.0, -0.02),
        metavar=("X", "Y", "Z"), help="virtual camera's position, y up (0 0 -0.02)")  # fmt: skip
    add("--camerarot", nargs=3, type=values.number(), metavar=("X", "Y", "Z"),
        help="its rotation about x, y and z, degrees: Rx Ry Rz (0 0 0)")  # fmt: skip
    add(
        "--outputfov", type=values.angle, default=45.0, metavar="DEG", help="its field of view (45)"
    )
    add("--outputdim", nargs=2, type=values.count(1, 65536), default=(256, 256), metavar=("W", "H"),
        help="pixels of its picture (256 256)")  # fmt: skip
    add = command.add_argument_group("focus (one of)").add_mutually_exclusive_group().add_argument
    add("--focalplanez", type=values.number(), metavar="Z", help="plane before data cameras (10)")
    add("--focaldistance", type=values.positive, metavar="D", help="along the camera's axis (10)")
    add("--focalsurface", type=surface, metavar="SURFACE",
        help="plane:X,Y,Z,NX,NY,NZ (point and normal, y up), sphere:X,Y,Z,R (its far side), or an "
        "EXR of depths along the virtual camera's axis")  # fmt: skip
    add = command.add_argument_group("method").add_argument
    add("--filterwidth", type=values.positive, metavar="R", help="Isaksen's radius, metres (0.05)")
    add("--montecarlo", action="store_true", help="integrate over a thin lens")
    add("--lensradius", type=values.number(0), metavar="R", help="of the thin lens, metres (0)")
    add("--samplesperpixel", type=values.count(), metavar="S", help="rays per pixel (1)")
    add("--sampler", type=sampler, metavar="NAME[:SEED]",
        help="of a lens: halton, stratified, independent, or quadrature, a fixed rule without "
        "noise (halton:0)")  # fmt: skip
    add("--lens", type=lens, metavar="FILE[,KEY=MM...]",
        help="realistic lens, a pbrt lens file; keys: stop (the stop's diameter), film (the "
        "film's diagonal, 35)")  # fmt: skip
    add_option(command, "device")
    add_bits(command)


def surface(text: str) -> tuple[str, list[float]]:
    """Read kind and numbers of ``plane:...`` or ``sphere:...``, or the name of a depth map."""
    kind, _, rest = text.partition(":")
    size = {"plane": 6, "sphere": 4}.get(kind)
    if size is None:
        return text, []
    read = values.number()
    numbers = [read(part) for part in rest.split(",")]
    if len(numbers) != size:
        raise argparse.ArgumentTypeError(f"{text!r} does not have the {size} numbers of a {kind}")
    return kind, numbers


def sampler(text: str) -> tuple[str, int]:
    """Read a sampler's name and seed."""
    name, _, seed = text.partition(":")
    known = ("halton", "stratified", "independent", QUADRATURE)
    if name not in known:
        raise argparse.ArgumentTypeError(f"{text!r} is not one of {', '.join(known)}")
    return name, values.count(0)(seed or "0")


def lens(text: str) -> tuple[Path, dict[str, float]]:
    """Read a lens file's name, and metres by key."""
    file, *parts = text.split(",")
    metres = {}
    for part in parts:
        key, _, millimetres = part.partition("=")
        if key not in ("stop", "film"):
            raise argparse.ArgumentTypeError(f"{part!r} is neither stop=MM nor film=MM")
        metres[key] = values.positive(millimetres) * 1e-3
    return Path(file), metres


def lightfield(arguments: argparse.Namespace) -> None:
    """Synthesise and write a picture."""
    from lfcore.refocus.array.device_field import DeviceField
    from lfcore.refocus.array.virtual_camera import VirtualCamera

    path, method = output(arguments), chosen_method(arguments)
    image, recorded, _ = read_lightfield(arguments.input)
    array = geometry(arguments, recorded, image.shape)
    camera = VirtualCamera.from_pbrt(
        arguments.camerapos, arguments.camerarot or (0.0, 0.0, 0.0), arguments.outputfov,
        arguments.outputdim, arguments.lensradius or 0.0,
    )  # fmt: skip
    field = DeviceField(arguments.device or lfcore.open_device(), image, array)
    result = _synthesise(method, arguments, field, camera)
    if not result.coverage.any():
        problem = "no pixel sees any data camera"
        remedy = "Widen --filterwidth, or move --camerapos towards the grid"
        raise OpticsError(problem, file=arguments.input, remedy=remedy)
    lfcore.write_picture(path, result.image, half=arguments.bits == 16)
    wrote(path, f": {method}, {camera.size[0]} x {camera.size[1]}, "
          f"{100 * result.skipped_share:.2f} % of samples outside the array")  # fmt: skip


def chosen_method(arguments: argparse.Namespace) -> str:
    """``isaksen``, ``montecarlo``, ``quadrature`` or ``realistic``.

    The options of the tool of 2019-2022, which had only the thin lens, select Monte Carlo.
    """
    by_rule = arguments.sampler is not None and arguments.sampler[0] == QUADRATURE
    methods = {QUADRATURE: by_rule, "realistic": arguments.lens is not None,
               "montecarlo": arguments.montecarlo}  # fmt: skip
    chosen = [name for name, is_given in methods.items() if is_given]
    if len(chosen) > 1:
        raise OpticsError(f"{' and '.join(chosen)} exclude each other", remedy="Choose one")
    if not chosen and not flags(arguments, "focaldistance", "camerarot", "sampler"):
        if wrong := flags(arguments, "lensradius", "samplesperpixel"):
            refuse(wrong[0], "is for a lens", "Add --montecarlo, or use --filterwidth")
        return "isaksen"
    if arguments.filterwidth is not None and not arguments.montecarlo:
        # With --montecarlo, the assignment allows a filter width without effect.
        refuse("--filterwidth", "is for Isaksen's filter", "Leave it out")
    return chosen[0] if chosen else "montecarlo"


def focal_surface(arguments: argparse.Namespace, camera: VirtualCamera) -> FocalSurface:
    """The surface that the focus options describe; a plane at z = 10 by default."""
    from lfcore.exr import read_exr_picture
    from lfcore.refocus.array import focal_surface as surfaces

    if arguments.focaldistance is not None:
        return surfaces.at_distance(camera, arguments.focaldistance)
    if arguments.focalsurface is not None:
        kind, numbers = arguments.focalsurface
        if not numbers:
            return surfaces.DepthMapSurface(read_exr_picture(kind)[..., 0])
        x, y, z, *more = numbers
        if kind == "sphere":
            return surfaces.SphereSurface(np.array([x, -y, z]), more[0])
        nx, ny, nz = more
        return surfaces.PlaneSurface(np.array([x, -y, z]), np.array([nx, -ny, nz]))
    if arguments.focalplanez is None and arguments.camerarot is not None:
        return surfaces.at_distance(camera, 10.0)
    return surfaces.parallel(10.0 if arguments.focalplanez is None else arguments.focalplanez)


def _synthesise(
    method: str, arguments: argparse.Namespace, field: DeviceField, camera: VirtualCamera
) -> Synthesis:
    from lfcore.optics.lens_system import LensSystem
    from lfcore.refocus.array.focal_surface import inverse_depth
    from lfcore.refocus.array.synthesis import isaksen, monte_carlo, quadrature, realistic

    surface = focal_surface(arguments, camera)
    samples = arguments.samplesperpixel or 1
    name, seed = arguments.sampler or ("halton", 0)
    if method == "isaksen":
        return isaksen(field, camera, surface, arguments.filterwidth or 0.05)
    if method == "montecarlo":
        return monte_carlo(field, camera, surface, samples, sampler=name, seed=seed)
    if method == QUADRATURE:
        # The next square number of lens points, with 2 x 2 film points each.
        return quadrature(field, camera, surface, math.ceil(math.sqrt(samples / 4)), 2)
    file, sizes = arguments.lens
    system = LensSystem.read(file)
    if "stop" in sizes:
        system = system.stopped_down(sizes["stop"])
    # Focused at the intersection of the focal surface with the lens's axis.
    middle, axis = np.array([camera.size]) / 2.0, camera.rotation[:, 2][None]
    inverse = float(inverse_depth(surface, camera, camera.position_m[None], axis, middle)[0])
    return realistic(
        field, camera, system.focused(1 / inverse if inverse > 0 else math.inf), surface, samples,
        film_diagonal_m=sizes.get("film", 0.035), sampler=name, seed=seed,
    )  # fmt: skip


TOOLS = {
    "lightfield": (
        Command(LIGHTFIELD, LIGHTFIELD_EXAMPLES, _lightfield_options, lightfield),
        "synthesise a picture from a light field",
    ),
    "convert": _tool("turn an EXR into a picture to look at", _convert_options, convert),
    "store": _tool("store a camera array's EXR as a light field file", _store_options, store),
    "tiles": _tool("write a light field file's views as one tiled EXR", _tiles_options, tiles),
}
"""The tools by name, each with its line in the list of tools."""
COMMANDS = {"imgtool": Command(DESCRIPTION, "", options)}
