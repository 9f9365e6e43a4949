"""``lfcore render`` and ``lfcore trace``."""

from __future__ import annotations

import argparse
import math
import os
from dataclasses import replace
from pathlib import Path

from lfcore.cli import imgtool_store, render_view
from lfcore.cli import planes as plane_options
from lfcore.cli.command import add_command
from lfcore.cli.progress import progress, say
from lfcore.errors import LfcoreError, OpticsError
from lfcore.optics.camera import Camera
from lfcore.pictures import check_suffix
from lfcore.storage.pixels import PIXEL_FORMATS

RENDER = """\
Trace a scene and make pictures from its rays at once; no light field is stored. SCENE is a
scene.yaml, a folder that holds one, a mesh (GLB, OBJ, PLY, STL, ...) or a .pbrt file."""
RENDER_EPILOG = """\
examples:
  lfcore render scenes/bike -o bike.png --size 512 --views 16
  lfcore render table.glb -o table.png --focus 2.5 --f-number 1.4
      a single picture is traced at its own focus: every ray counts in the pixel it is sent from
  lfcore render scene.pbrt -o scene.exr
      as the file says: film, rays a pixel, lens or Camera "lightfield", shutter
  lfcore render scene.pbrt -o square.exr --size 256 --pinhole
      one ray a pixel, all in focus
  lfcore render scenes/bike -o bike.png --plane focus=2 --plane focus=6
      several pictures from the same rays (Algorithm 1 of the thesis)
"""
TRACE = """\
Trace a scene into a light field file that 'lfcore refocus' makes pictures from: N x N views of
M x M pixels, as H.264 video or another codec. SCENE is as for 'lfcore render'."""
TRACE_EPILOG = """\
examples:
  lfcore trace scenes/bike -o bike.mkv --size 256 --views 32
  lfcore trace table.glb -o table.mkv --size 512 --views 16 --layout views --crf 18
  lfcore trace table.glb -o table.mkv --size 128 --views 16 --codec ffv1     lossless video
  lfcore trace scene.pbrt -o scene.mkv
      a scene with Camera "lightfield": its own cameras, rays a pixel and shutter
"""


def add_parser(commands, name: str, summary: str) -> None:
    text = (RENDER, RENDER_EPILOG) if name == "render" else (TRACE, TRACE_EPILOG)
    command = add_command(commands, name, summary, text[0], text[1])
    add_scene(command)
    if name == "render":
        command.add_argument("-o", "--output", type=Path, required=True, help="picture to write")
        command.add_argument("--views", type=int, metavar="N", help="N x N rays a pixel (16)")
        command.add_argument("--pinhole", action="store_true", help="one ray through a point")
        plane_options.add_options(command)
        render_view.add_options(command)
        # None: not asked for, so that a scene with a film of its own is taken as it is.
        command.set_defaults(run=render, size=None)
        return
    command.add_argument("-o", "--output", type=Path, required=True, help="file to write, .mkv")
    command.add_argument("--views", type=int, metavar="N", help="N x N views (16)")
    lens = command.add_argument_group("the lens (default: the scene's)")
    lens.add_argument("--focus", type=plane_options.distance, metavar="M", help="metres, or 'inf'")
    lens.add_argument("--f-number", type=float, metavar="F", help="widest that can be refocused")
    how = imgtool_store.add_encoder(command)
    how.add_argument("--layout", choices=("macropixels", "views"), help="default: by N and M")
    how.add_argument("--pixel-format", choices=tuple(PIXEL_FORMATS), help="default: by N")
    render_view.add_options(command)
    command.set_defaults(run=trace, size=None)


def add_scene(command: argparse.ArgumentParser) -> None:
    """Options of every command that traces a scene."""
    command.add_argument("scene", type=Path, help="scene.yaml, its folder, a mesh or a .pbrt file")
    command.add_argument("--size", type=int, default=256, metavar="M", help="M x M pixels (256)")
    command.add_argument("--device", help="part of an OpenCL device's name")


def load(path: Path):
    """The scene of any file that describes one; what could not be read exactly is told.

    Raises :class:`SceneError` for whatever is wrong with it.
    """
    from lfcore.scene.build import build_scene
    from lfcore.scene.files import load_scene

    if path.suffix.lower() == ".npz":
        return load_scene(path)
    scene = build_scene(path)
    if scene.notes:
        say(scene.summary())
    return scene


def say_what_is_in(scene) -> None:
    """How many triangles the scene has, and what was left out of it."""
    say(f"{scene.name}: {scene.triangle_count} triangles")
    for reason, count in scene.dropped.items():
        say(f"{count} triangles were left out: {reason}")


def open_tracer(scene, device: str | None):
    """A tracer of the scene, with a line of progress for its hierarchy."""
    from lfcore.opencl.device import open_device
    from lfcore.tracing.bvh import build_bvh
    from lfcore.tracing.tracer import Tracer

    say_what_is_in(scene)
    opened = open_device(device)
    return Tracer(scene, build_bvh(scene.triangles), opened)


def open_tracers(scene, device: str | None) -> list:
    """One tracer a core, each of one thread, or a single one for a device beside the CPU."""
    from lfcore.opencl.device import open_device
    from lfcore.tracing.bvh import build_bvh
    from lfcore.tracing.tracer import Tracer

    say_what_is_in(scene)
    opened, bvh = open_device(device), build_bvh(scene.triangles)
    if not opened.is_cpu:
        return [Tracer(scene, bvh, opened)]
    return [Tracer(scene, bvh, open_device(device, threads=1)) for _ in range(opened.threads)]


def recorded_camera(camera: Camera, focus: float | None, f_number: float | None) -> Camera:
    """The scene's camera with another focus or lens; the extent of the picture stays."""
    from lfcore.optics.planes import SensorPlane
    from lfcore.rendering.direct import focused_camera

    plane = SensorPlane(
        camera.focus_distance_m if focus is None else focus,
        camera.f_number if f_number is None else f_number,
    )
    return focused_camera(camera, plane)


def render(arguments: argparse.Namespace) -> None:
    from lfcore.cli.refocus import save
    from lfcore.optics.slab import Slab
    from lfcore.rendering.direct import trace_picture, trace_planes

    check_suffix(arguments.output)
    if arguments.pinhole and (arguments.views or arguments.f_number or arguments.plane):
        raise OpticsError(
            "has neither aperture nor focus", key="--pinhole",
            remedy="Leave out --views, --f-number and --plane",
        )  # fmt: skip
    scene = load(arguments.scene)
    if render_view.wants_film(arguments, scene):
        say_what_is_in(scene)
        render_view.render_film(arguments, scene)
        return
    size = 256 if arguments.size is None else arguments.size
    views = 1 if arguments.pinhole else 16 if arguments.views is None else arguments.views
    planes = plane_options.read_planes(arguments, scene.camera)
    widest = min(plane.f_number for plane in planes)
    # A wider lens than the scene's can be traced: the scene knows all light.
    camera = replace(scene.camera, f_number=min(widest, scene.camera.f_number))
    slab = Slab(camera, views, size)
    plane_options.check_planes(planes, slab, arguments.scene)
    tracer = open_tracer(scene, arguments.device)
    with progress(f"tracing {slab.rays:,} rays", "pixels") as report:
        if len(planes) == 1:
            pictures = trace_picture(
                tracer, camera, slab.pixels, planes[0], views=views, progress=report
            )[None]
        else:
            pictures = trace_planes(tracer, slab, planes, progress=report)
    save(arguments.output, planes, pictures)


def trace(arguments: argparse.Namespace) -> None:
    from lfcore.optics.slab import Slab
    from lfcore.rendering.record import record
    from lfcore.storage.defaults import frame_layout

    check_suffix(arguments.output, (".mkv",))
    scene = load(arguments.scene)
    if render_view.wants_film(arguments, scene) and scene.view.kind == "lightfield":
        render_view.trace_film(arguments, scene)
        return
    views = 16 if arguments.views is None else arguments.views
    size = 256 if arguments.size is None else arguments.size
    camera = recorded_camera(scene.camera, arguments.focus, arguments.f_number)
    if not math.isfinite(camera.field_width):
        raise LfcoreError("the picture has no extent", file=arguments.scene)
    slab = Slab(camera, views, size)
    spec = imgtool_store.asked_spec(arguments, views)
    layout = frame_layout(views, size, spec.pixel_format, kind=arguments.layout or "auto")
    tracers = open_tracers(scene, arguments.device)
    with progress(f"tracing {slab.rays:,} rays", "elements") as report:
        metadata = record(
            arguments.output, tracers, slab, layout, spec, scene=arguments.scene, progress=report
        )
    size = os.path.getsize(arguments.output)
    say(f"wrote {arguments.output}: {len(metadata.segments)} segments, {size:,} bytes")
