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

import numpy as np

from lfcore.cli import imgtool_store
from lfcore.cli.command import add_command
from lfcore.errors import OpticsError
from lfcore.optics.array import CameraArray

DESCRIPTION = "Make pictures from a camera array's light field, or convert EXR pictures."


def add_parser(commands, name: str, summary: str) -> None:
    command = add_command(commands, name, summary, DESCRIPTION)
    tools = command.add_subparsers(dest="tool", required=True, metavar="TOOL")

    def add_tool(tool: str, run: Callable, text: str, more: str = "") -> argparse.ArgumentParser:
        added = tools.add_parser(tool, help=text, description=f"{text.capitalize()}. {more}")
        # What a tool has to say is its result: it goes to standard output.
        added.set_defaults(run=lambda arguments: print(run(arguments)))
        return added

    _lightfield_options(
        add_tool(
            "lightfield", lightfield, "synthesise a picture from a light field",
            "Without --montecarlo, --focaldistance or --camerarot: Isaksen's filter; with one of "
            "them a thin lens. Geometry in the EXR's header makes --camsperdim, --griddim and "
            "--inputfov optional.",
        )
    )  # fmt: skip
    _convert_options(add_tool("convert", convert, "turn an EXR into a picture to look at"))
    store = add_tool(
        "store", lambda given: imgtool_store.store(given, geometry),
        "store a camera array's EXR as video, to be opened like any light field file",
    )  # fmt: skip
    _array_options(store)
    imgtool_store.add_encoder(store)
    store.add_argument("input", type=Path, help="EXR that holds all data cameras")
    store.add_argument("output", type=Path, help="light field file to write, .mkv")
    text = "write the views of a light field file, array or slab, as one tiled EXR"
    imgtool_store.add_tiles(add_tool("tiles", imgtool_store.tiles, text))


def _convert_options(convert: argparse.ArgumentParser) -> None:
    convert.add_argument(
        "--tonemap",
        action="store_true",
        help="Reinhard's global operator on luminance, scaled by the brightest pixel",
    )
    convert.add_argument("--scale", type=float, default=1.0, help="multiply radiance first")
    convert.add_argument("input", type=Path)
    convert.add_argument("output", type=Path)


def _array_options(command: argparse.ArgumentParser) -> None:
    array = command.add_argument_group("the light field (from the header where it has one)")
    array.add_argument(
        "--camsperdim", nargs=2, type=int, metavar=("X", "Y"), help="data cameras (1 1)"
    )
    array.add_argument(
        "--griddim", nargs=4, type=float, metavar=("XMIN", "XMAX", "YMIN", "YMAX"),
        help="bounding box of the data cameras, metres (0 0 0 0)",
    )  # fmt: skip
    array.add_argument("--inputfov", type=float, help="field of view of data cameras (90)")
    array.add_argument(
        "--spacing", choices=("ends", "cells"),
        help="outermost cameras on the bounds, or all in the middle of cells (ends)",
    )  # fmt: skip


def _lightfield_options(command: argparse.ArgumentParser) -> None:
    add = command.add_argument
    _array_options(command)
    add(
        "--camerapos", nargs=3, type=float, default=(0.0, 0.0, -0.02), metavar=("X", "Y", "Z"),
        help="position of the virtual camera, y up (0 0 -0.02)",
    )  # fmt: skip
    add(
        "--camerarot", nargs=3, type=float, metavar=("X", "Y", "Z"),
        help="its rotation about x, y and z, degrees: Rx Ry Rz (0 0 0)",
    )  # fmt: skip
    add("--outputfov", type=float, default=45.0, help="its field of view, degrees (45)")
    add("--outputdim", nargs=2, type=int, default=(256, 256), metavar=("W", "H"))
    _focus_options(command)
    _method_options(command)
    add("--device", help="part of an OpenCL device's name")
    add("--half", action="store_true", help="write 16-bit floats")
    add("input", type=Path, help="EXR of all data cameras, or a light field file, .mkv")
    add("output", type=Path, help="EXR to write")


def _focus_options(command: argparse.ArgumentParser) -> None:
    focus = command.add_argument_group("focus (one of)")
    focus = focus.add_mutually_exclusive_group()
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
    method = command.add_argument_group("method")
    method.add_argument("--filterwidth", type=float, help="radius of Isaksen's cone, metres (0.05)")
    method.add_argument("--montecarlo", action="store_true", help="integrate over a thin lens")
    method.add_argument(
        "--quadrature", action="store_true", help="thin lens by a fixed rule, without noise"
    )
    method.add_argument("--lensradius", type=float, help="of the thin lens, metres (0)")
    method.add_argument("--samplesperpixel", type=int, help="rays a pixel (1)")
    method.add_argument(
        "--sampler", choices=("halton", "stratified", "independent"), default="halton"
    )
    method.add_argument("--seed", type=int, default=0)
    method.add_argument("--lens", type=Path, help="pbrt lens file: a realistic lens")
    method.add_argument(
        "--aperturediameter", type=float, help="of the realistic lens's stop, millimetres"
    )
    method.add_argument(
        "--filmdiagonal", type=float, default=35.0, help="behind the realistic lens, mm (35)"
    )


def lightfield(arguments: argparse.Namespace) -> str:
    """Synthesise and write a picture; returns one line about it.

    Raises :class:`LfcoreError` for flags that contradict the header, each other or the picture.
    """
    from lfcore.opencl.device import open_device
    from lfcore.pictures import write_picture
    from lfcore.refocus.array.device_field import DeviceField
    from lfcore.refocus.array.virtual_camera import VirtualCamera

    method = chosen_method(arguments)
    image, recorded, _ = imgtool_store.read_lightfield(arguments.input)
    array = geometry(arguments, recorded, image.shape)
    camera = VirtualCamera.from_pbrt(
        arguments.camerapos,
        arguments.camerarot or (0.0, 0.0, 0.0),
        arguments.outputfov,
        arguments.outputdim,
        arguments.lensradius or 0.0,
    )
    field = DeviceField(open_device(arguments.device), image, array)
    result = _synthesise(method, arguments, field, camera)
    if not result.coverage.any():
        raise OpticsError(
            "no pixel sees any data camera",
            file=arguments.input,
            remedy="Widen --filterwidth, or move --camerapos towards the grid",
        )
    write_picture(arguments.output, result.image, half=arguments.half)
    return (
        f"{arguments.output}: {method}, {camera.size[0]} x {camera.size[1]}, "
        f"{100 * result.skipped_share:.2f} % of samples outside the array"
    )


def chosen_method(arguments: argparse.Namespace) -> str:
    """``isaksen``, ``montecarlo``, ``quadrature`` or ``realistic``.

    The tool of 2019-2022 knew the thin lens alone, so its own options choose it.  Raises
    :class:`OpticsError` for options of different methods.
    """
    chosen = [
        name
        for name, given in (
            ("quadrature", arguments.quadrature),
            ("realistic", arguments.lens is not None),
            ("montecarlo", arguments.montecarlo),
        )
        if given
    ]
    if len(chosen) > 1:
        raise OpticsError(f"{' and '.join(chosen)} exclude each other", remedy="Choose one")
    later = arguments.focaldistance is not None or arguments.camerarot is not None
    if not chosen and not later:
        if arguments.lensradius is not None or arguments.samplesperpixel is not None:
            raise OpticsError(
                "--lensradius and --samplesperpixel belong to a lens",
                remedy="Add --montecarlo, or use --filterwidth",
            )
        return "isaksen"
    if arguments.filterwidth is not None and not arguments.montecarlo:
        # With --montecarlo the assignment itself calls the filter width useless, not wrong.
        raise OpticsError("--filterwidth belongs to Isaksen's filter", remedy="Leave it out")
    return chosen[0] if chosen else "montecarlo"


def geometry(
    arguments: argparse.Namespace, recorded: CameraArray | None, shape: tuple[int, ...]
) -> CameraArray:
    """The array from the header, from flags, or both where they agree.

    Raises :class:`OpticsError` for a contradiction, naming the flag.
    """
    flags = {
        name: getattr(arguments, name)
        for name in ("camsperdim", "griddim", "inputfov", "spacing")
        if getattr(arguments, name) is not None
    }
    if recorded is None:
        cameras = flags.get("camsperdim", (1, 1))
        for length, count in zip(shape[1::-1], cameras, strict=True):
            if count < 1 or length % count:
                raise OpticsError(
                    f"{cameras[0]} x {cameras[1]} cameras do not divide {shape[1]} x {shape[0]} "
                    "pixels",
                    file=arguments.input,
                    key="--camsperdim",
                    remedy="Give the number of cameras that the light field was made with",
                )
        tile = (shape[1] // cameras[0], shape[0] // cameras[1])
        bounds = flags.get("griddim", (0.0, 0.0, 0.0, 0.0))
        fov = flags.get("inputfov", 90.0)
        return CameraArray.on_grid(cameras, bounds, fov, tile, flags.get("spacing", "ends"))
    _check_agreement(flags, recorded, arguments.input)
    return recorded


def _check_agreement(flags: dict, recorded: CameraArray, file: Path) -> None:
    spacing = flags.get("spacing") or ("cells" if any(recorded.margin_m) else "ends")
    bounds = recorded.bounds()
    facts = {
        "camsperdim": recorded.cameras,
        "griddim": (bounds[0], bounds[1], -bounds[3], -bounds[2]),
        "inputfov": recorded.fov_deg,
    }
    for name, fact in facts.items():
        if name in flags and not np.allclose(flags[name], fact, rtol=1e-5, atol=1e-9):
            said = " ".join(f"{value:g}" for value in np.atleast_1d(fact))
            raise OpticsError(
                f"contradicts the header, which says {said}",
                file=file,
                key=f"--{name}",
                remedy="Leave the flag out",
            )
    if "spacing" in flags:
        again = CameraArray.on_grid(
            recorded.cameras, facts["griddim"], recorded.fov_deg, recorded.tile, spacing
        )
        if not (
            np.allclose(again.columns_m, recorded.columns_m)
            and np.allclose(again.rows_m, recorded.rows_m)
        ):
            raise OpticsError(
                "contradicts the camera positions in the header", file=file, key="--spacing",
                remedy="Leave the flag out",
            )  # fmt: skip


def focal_surface(arguments: argparse.Namespace, camera):
    """The surface that the focus options describe; a plane at z = 10 by default."""
    from lfcore.exr import read_exr_picture
    from lfcore.refocus.array import focal_surface as surfaces

    if arguments.focaldistance is not None:
        return surfaces.at_distance(camera, arguments.focaldistance)
    if arguments.focalplane is not None:
        x, y, z, nx, ny, nz = arguments.focalplane
        return surfaces.PlaneSurface([x, -y, z], [nx, -ny, nz])
    if arguments.focalsphere is not None:
        x, y, z, radius = arguments.focalsphere
        return surfaces.SphereSurface([x, -y, z], radius)
    if arguments.depthmap is not None:
        return surfaces.DepthMapSurface(read_exr_picture(arguments.depthmap)[..., 0])
    if arguments.focalplanez is None and arguments.camerarot is not None:
        return surfaces.at_distance(camera, 10.0)
    return surfaces.parallel(10.0 if arguments.focalplanez is None else arguments.focalplanez)


def _synthesise(method: str, arguments: argparse.Namespace, field, camera):
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
    lens = lens.focused(_lens_focus(arguments, camera))
    diagonal = arguments.filmdiagonal * 1e-3
    return realistic(field, camera, lens, surface, samples, film_diagonal_m=diagonal, **draw)


def _lens_focus(arguments: argparse.Namespace, camera) -> float:
    """Focus of a realistic lens: where the focal surface crosses its axis."""
    from lfcore.refocus.array.focal_surface import inverse_depth

    surface = focal_surface(arguments, camera)
    middle = np.array([camera.size]) / 2.0
    axis = camera.rotation[:, 2][None]
    q = inverse_depth(surface, camera, camera.position_m[None], axis, middle)
    return 1.0 / float(q[0]) if q[0] > 0 else math.inf


def convert(arguments: argparse.Namespace) -> str:
    """Write a linear EXR as an 8-bit sRGB picture; returns one line about it.

    Raises :class:`LfcoreError` when either file is at fault.
    """
    from lfcore.exr import read_exr_picture
    from lfcore.pictures import ALL_CODED, check_suffix, write_picture

    check_suffix(arguments.output, ALL_CODED, "output")
    image = np.nan_to_num(read_exr_picture(arguments.input).astype(np.float64)) * arguments.scale
    if arguments.tonemap:
        image = tonemap(image)
    write_picture(arguments.output, image)
    return f"{arguments.output}: {image.shape[1]} x {image.shape[0]}"


def tonemap(image: np.ndarray) -> np.ndarray:
    """Reinhard et al. 2002, equation 4, on luminance (BT.709), white at the brightest pixel."""
    luminance = image @ np.array([0.2126, 0.7152, 0.0722])
    white = max(float(luminance.max()), 1e-12)
    scale = (1.0 + luminance / white**2) / (1.0 + luminance)
    return image * scale[..., None]
