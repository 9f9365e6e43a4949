"""``lfcore imgtool``: pictures from camera arrays on the command line, as the assignment has it.

Both years' options are understood: the Isaksen filter of 2016-2018 (``--filterwidth``,
``--focalplanez``) and the Monte Carlo thin lens of 2019-2022 (``--focaldistance``,
``--camerarot``).
All coordinates are pbrt's: x right, y up, z forward, the data cameras in z = 0.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import lfcore
from lfcore.cli import imgtool_store as arrays
from lfcore.cli.command import Command, refuse
from lfcore.cli.options import add_device, add_encoder
from lfcore.errors import OpticsError

if TYPE_CHECKING:
    from lfcore.refocus.array.device_field import DeviceField
    from lfcore.refocus.array.focal_surface import FocalSurface
    from lfcore.refocus.array.result import Synthesis
    from lfcore.refocus.array.virtual_camera import VirtualCamera

DESCRIPTION = "Make pictures from a camera array's light field, or convert EXR pictures."


def options(command: argparse.ArgumentParser) -> None:
    tools = command.add_subparsers(dest="tool", required=True, metavar="TOOL")

    def add_tool(
        tool: str, run: Callable[[argparse.Namespace], str], text: str, more: str = ""
    ) -> argparse.ArgumentParser:
        added = tools.add_parser(
            tool, help=text, description=f"{text[0].upper()}{text[1:]}. {more}"
        )
        # What a tool has to say is its result: it goes to standard output.
        added.set_defaults(run=lambda arguments: print(run(arguments)))
        return added

    def add_files(added: argparse.ArgumentParser, what: str, where: str) -> None:
        added.add_argument("input", type=Path, help=what)
        added.add_argument("output", type=Path, help=where)

    text = "synthesise a picture from a light field"
    more = (
        "Without --montecarlo, --focaldistance or --camerarot: Isaksen's filter; with one of them "
        "a thin lens. Geometry in the EXR's header makes --camsperdim, --griddim and --inputfov "
        "optional."
    )
    tool = add_tool("lightfield", lightfield, text, more)
    _lightfield_options(tool)
    add_files(tool, "EXR of all data cameras, or a light field file, .mkv", "EXR to write")

    tool = add_tool("convert", arrays.convert, "turn an EXR into a picture to look at")
    tool.add_argument(
        "--tonemap", action="store_true",
        help="Reinhard's global operator on luminance, scaled by the brightest pixel",
    )  # fmt: skip
    tool.add_argument("--scale", type=float, default=1.0, help="multiply radiance first")
    add_files(tool, "EXR to read", "picture to write")

    text = "store a camera array's EXR as video, to be opened like any light field file"
    tool = add_tool("store", arrays.store, text)
    arrays.add_geometry(tool)
    add_encoder(tool, of_array=True)
    add_files(tool, "EXR that holds all data cameras", "light field file to write, .mkv")

    text = "write the views of a light field file, array or slab, as one tiled EXR"
    tool = add_tool("tiles", arrays.tiles, text)
    tool.add_argument("--half", action="store_true", help="write 16-bit floats")
    where = "EXR to write, all views side by side"
    add_files(tool, "light field file, .mkv: array or slab", where)


def _lightfield_options(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    arrays.add_geometry(command)
    add(
        "--camerapos", nargs=3, type=float, default=(0.0, 0.0, -0.02), metavar=("X", "Y", "Z"),
        help="position of the virtual camera, y up (0 0 -0.02)",
    )  # fmt: skip
    add(
        "--camerarot", nargs=3, type=float, metavar=("X", "Y", "Z"),
        help="its rotation about x, y and z, degrees: Rx Ry Rz (0 0 0)",
    )  # fmt: skip
    add("--outputfov", type=float, default=45.0, help="its field of view, degrees (45)")
    add("--outputdim", nargs=2, type=int, default=(256, 256), metavar=("W", "H"),
        help="pixels of its picture (256 256)")  # fmt: skip
    _focus_options(command)
    _method_options(command)
    add_device(command)
    add("--half", action="store_true", help="write 16-bit floats")


def _focus_options(command: argparse.ArgumentParser) -> None:
    focus = command.add_argument_group("focus (one of)").add_mutually_exclusive_group()
    focus.add_argument("--focalplanez", type=float, help="plane before the data cameras (10)")
    focus.add_argument("--focaldistance", type=float, help="along the virtual camera's axis (10)")
    focus.add_argument(
        "--focalplane", nargs=6, type=float, metavar=("X", "Y", "Z", "NX", "NY", "NZ"),
        help="tilted plane: a point and a normal, y up",
    )  # fmt: skip
    focus.add_argument(
        "--focalsphere", nargs=4, type=float, metavar=("X", "Y", "Z", "R"),
        help="far side of a sphere: centre, y up, and radius",
    )  # fmt: skip
    focus.add_argument("--depthmap", type=Path, help="EXR of depths along the camera's axis")


def _method_options(command: argparse.ArgumentParser) -> None:
    add = command.add_argument_group("method").add_argument
    add("--filterwidth", type=float, help="radius of Isaksen's cone, metres (0.05)")
    add("--montecarlo", action="store_true", help="integrate over a thin lens")
    add("--quadrature", action="store_true", help="thin lens by a fixed rule, without noise")
    add("--lensradius", type=float, help="of the thin lens, metres (0)")
    add("--samplesperpixel", type=int, help="rays a pixel (1)")
    add("--sampler", choices=("halton", "stratified", "independent"), default="halton",
        help="of the rays of Monte Carlo (halton)")  # fmt: skip
    add("--seed", type=int, default=0, help="of the sampler (0)")
    add("--lens", type=Path, help="pbrt lens file: a realistic lens")
    add("--aperturediameter", type=float, help="of the realistic lens's stop, millimetres")
    add("--filmdiagonal", type=float, default=35.0, help="behind the realistic lens, mm (35)")


def lightfield(arguments: argparse.Namespace) -> str:
    """Synthesise and write a picture; returns one line about it.

    Raises :class:`LfcoreError` for flags that contradict the header, each other or the picture.
    """
    from lfcore.refocus.array.device_field import DeviceField
    from lfcore.refocus.array.virtual_camera import VirtualCamera

    method = chosen_method(arguments)
    image, recorded, _ = arrays.read_lightfield(arguments.input)
    array = arrays.geometry(arguments, recorded, image.shape)
    camera = VirtualCamera.from_pbrt(
        arguments.camerapos, arguments.camerarot or (0.0, 0.0, 0.0), arguments.outputfov,
        arguments.outputdim, arguments.lensradius or 0.0,
    )  # fmt: skip
    field = DeviceField(lfcore.open_device(arguments.device), image, array)
    result = _synthesise(method, arguments, field, camera)
    if not result.coverage.any():
        raise OpticsError(
            "no pixel sees any data camera", file=arguments.input,
            remedy="Widen --filterwidth, or move --camerapos towards the grid",
        )  # fmt: skip
    lfcore.write_picture(arguments.output, result.image, half=arguments.half)
    return (
        f"{arguments.output}: {method}, {camera.size[0]} x {camera.size[1]}, "
        f"{100 * result.skipped_share:.2f} % of samples outside the array"
    )


def chosen_method(arguments: argparse.Namespace) -> str:
    """``isaksen``, ``montecarlo``, ``quadrature`` or ``realistic``.

    The tool of 2019-2022 knew the thin lens alone, so its own options choose it.  Raises
    :class:`OpticsError` for options of different methods.
    """
    asked = {"quadrature": arguments.quadrature, "realistic": arguments.lens is not None,
             "montecarlo": arguments.montecarlo}  # fmt: skip
    chosen = [name for name, given in asked.items() if given]
    if len(chosen) > 1:
        raise OpticsError(f"{' and '.join(chosen)} exclude each other", remedy="Choose one")
    later = arguments.focaldistance is not None or arguments.camerarot is not None
    if not chosen and not later:
        if arguments.lensradius is not None or arguments.samplesperpixel is not None:
            refuse(
                "--lensradius and --samplesperpixel", "belong to a lens",
                "Add --montecarlo, or use --filterwidth",
            )  # fmt: skip
        return "isaksen"
    if arguments.filterwidth is not None and not arguments.montecarlo:
        # With --montecarlo the assignment itself calls the filter width useless, not wrong.
        refuse("--filterwidth", "belongs to Isaksen's filter", "Leave it out")
    return chosen[0] if chosen else "montecarlo"


def focal_surface(arguments: argparse.Namespace, camera: VirtualCamera) -> FocalSurface:
    """The surface that the focus options describe; a plane at z = 10 by default."""
    from lfcore.exr import read_exr_picture
    from lfcore.refocus.array import focal_surface as surfaces

    if arguments.focaldistance is not None:
        return surfaces.at_distance(camera, arguments.focaldistance)
    if arguments.focalplane is not None:
        x, y, z, nx, ny, nz = arguments.focalplane
        return surfaces.PlaneSurface(np.array([x, -y, z]), np.array([nx, -ny, nz]))
    if arguments.focalsphere is not None:
        x, y, z, radius = arguments.focalsphere
        return surfaces.SphereSurface(np.array([x, -y, z]), radius)
    if arguments.depthmap is not None:
        return surfaces.DepthMapSurface(read_exr_picture(arguments.depthmap)[..., 0])
    if arguments.focalplanez is None and arguments.camerarot is not None:
        return surfaces.at_distance(camera, 10.0)
    return surfaces.parallel(10.0 if arguments.focalplanez is None else arguments.focalplanez)


def _synthesise(
    method: str, arguments: argparse.Namespace, field: DeviceField, camera: VirtualCamera
) -> Synthesis:
    from lfcore.optics.lens_system import LensSystem
    from lfcore.refocus.array.isaksen import isaksen
    from lfcore.refocus.array.monte_carlo import monte_carlo
    from lfcore.refocus.array.quadrature import quadrature
    from lfcore.refocus.array.realistic import realistic

    surface = focal_surface(arguments, camera)
    samples = 1 if arguments.samplesperpixel is None else arguments.samplesperpixel
    draw = {"sampler": arguments.sampler, "seed": arguments.seed}
    if method == "isaksen":
        width = 0.05 if arguments.filterwidth is None else arguments.filterwidth
        return isaksen(field, camera, surface, width)
    if method == "montecarlo":
        return monte_carlo(field, camera, surface, samples, **draw)
    if method == "quadrature":
        # As many lens points as asked for, or the next square above, at 2 x 2 film points.
        lens_points = max(1, math.ceil(math.sqrt(max(samples, 1) / 4)))
        return quadrature(field, camera, surface, lens_points, 2)
    lens = LensSystem.read(arguments.lens)
    if arguments.aperturediameter is not None:
        lens = lens.stopped_down(arguments.aperturediameter * 1e-3)
    lens = lens.focused(_lens_focus(surface, camera))
    diagonal = arguments.filmdiagonal * 1e-3
    return realistic(field, camera, lens, surface, samples, film_diagonal_m=diagonal, **draw)


def _lens_focus(surface: FocalSurface, camera: VirtualCamera) -> float:
    """Focus of a realistic lens: where the focal surface crosses its axis."""
    from lfcore.refocus.array.focal_surface import inverse_depth

    middle = np.array([camera.size]) / 2.0
    axis = camera.rotation[:, 2][None]
    q = inverse_depth(surface, camera, camera.position_m[None], axis, middle)
    return 1.0 / float(q[0]) if q[0] > 0 else math.inf


COMMANDS = {"imgtool": Command(DESCRIPTION, "", options, lambda arguments: None)}
