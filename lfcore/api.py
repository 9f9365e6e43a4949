"""What the library does, one function each: scenes from files, pictures and light fields of them.

    import lfcore

    scene = lfcore.load_scene("model.glb")
    picture = lfcore.render(scene, focus_m=3.2, f_number=2)
    field = lfcore.record(scene, "model.mkv", views=32, pixels=512, f_number=2)
    near = field.refocus(focus_m=2.0)

Distances are metres, pictures float32 arrays of linear light, rows from the top.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lfcore.errors import OpticsError
from lfcore.opencl.device import Device
from lfcore.optics.array import CameraArray
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.progress import Progress
from lfcore.rendering.by_depth import DEFAULT_COUNT, RayCount, pictures_by_depth
from lfcore.rendering.direct import focused_camera, trace_picture, trace_planes
from lfcore.rendering.prepared import open_tracer, open_tracers, opened
from lfcore.rendering.quality import (
    MOST_RAYS,
    Rendering,
    WantedQuality,
    planes_between,
)
from lfcore.scene.build import build_scene
from lfcore.scene.emitters import POINTS
from lfcore.scene.files import load_scene as load_prepared
from lfcore.scene.model import Scene
from lfcore.storage.defaults import AUTO, codec_spec, frame_layout
from lfcore.tracing.tracer import Tracer

if TYPE_CHECKING:
    from lfcore.lightfield import LightField

FILTERS = ("depth", "nearest")
STORED_COUNT = RayCount(4, 2)
"""Rays of a pixel in a file with depth (measured, docs/notebook/true-picture.md)."""
VIEWS = 16
"""Lens samples a side where rays count in the pixel that they fall on and no number is given."""
# Video and exposure are imported by the functions that need them: a picture is there sooner.


def load_scene(path: str | Path, *, light_points: int = POINTS, up: str = "y") -> Scene:
    """The scene of any file that describes one.

    Parameters
    ----------
    path : a ``scene.yaml`` or the folder that holds one, a mesh (GLB, OBJ, PLY, STL, ...), which
        gets a camera and a light, a ``.pbrt`` file, or a ``scene.npz`` of the workflow.  What a
        foreign format says and cannot be mapped exactly is in the scene's ``notes``.
    light_points : point lights that stand for each area light of a pbrt scene.
    up : ``y`` or ``z``, the axis of a mesh that points up; glTF's is y.

    Raises
    ------
    SceneError : the file is missing or damaged, or says what makes no scene.
    """
    path = Path(path)
    if path.suffix.lower() == ".npz":
        return load_prepared(path)
    return build_scene(path, light_points=light_points, up=up)


def render(
    scene: Scene,
    focus_m: float | None = None,
    f_number: float | None = None,
    *,
    planes: Sequence[SensorPlane] | None = None,
    pixels: int = 256,
    views: int | None = None,
    subpixels: float | None = None,
    filter: str = "depth",
    device: Device | str | None = None,
    progress: Progress | None = None,
) -> np.ndarray:
    """Pictures of a scene through its lens, without storing a light field.

    Parameters
    ----------
    focus_m : metres, ``math.inf`` allowed; default the scene's.
    f_number : of a round aperture; default the scene's.
    planes : several pictures from the same rays, instead of ``focus_m`` and ``f_number``.
    pixels : M, side of the pictures.
    views : N x N lens samples; default 8, or 16 with the filter ``nearest``.
    subpixels : side of the grid of rays of a lens sample and pixel; default 2, with ``nearest`` 1.
        No less than 1 with ``nearest``.
    filter : ``depth`` spreads a ray over what its part of lens and pixel sweeps at the depth that
        it met; with ``nearest`` it counts in the pixel that it falls on (Algorithm 1).
    device : open, or part of its name.
    progress : called with (done, of all).

    Returns
    -------
    (M, M, 3) float32, linear light; with ``planes`` (P, M, M, 3).  A single picture is traced at
    its own focus.

    Raises
    ------
    OpticsError : a plane that the lens cannot form, a filter that is not known, or rays that it
        does not take.
    DeviceError : no device, or none whose name fits.

    Source: docs/notebook/true-picture.md; thesis, Algorithm 1 and section 6.3.2.
    """
    if filter not in FILTERS:
        raise OpticsError(
            f"unknown filter {filter!r}", key="filter", remedy=f"Use one of {FILTERS}"
        )
    if planes is None:
        wanted = [SensorPlane.of(scene.camera, focus_m, f_number)]
    elif focus_m is not None or f_number is not None:
        raise OpticsError("excludes focus_m and f_number", key="planes", remedy="Give one of them")
    else:
        wanted = list(planes)
    camera = _lens_for(scene, wanted)
    count = rays_to_trace(filter, views, subpixels)
    if filter == "depth":
        tracer = open_tracer(scene, device)
        made = pictures_by_depth(tracer, camera, wanted, pixels, count, progress=progress)
    else:
        slab = Slab(camera, count.views, count.side(pixels))
        coarse = [replace(plane, pixels=pixels) for plane in wanted]
        made = _nearest(open_tracer(scene, device), slab, coarse, progress)
    return made[0] if planes is None else made


def rays_to_trace(filter: str, views: int | None, subpixels: float | None) -> RayCount:
    """Rays of a pixel that :func:`render` traces, by default those of the filter."""
    usual = DEFAULT_COUNT if filter == "depth" else RayCount(VIEWS, 1)
    return RayCount(views or usual.views, usual.subpixels if subpixels is None else subpixels)


def render_to_quality(
    scene: Scene,
    quality_db: float,
    *,
    planes: Sequence[SensorPlane] | None = None,
    pixels: int = 256,
    most_rays: float = MOST_RAYS,
    device: Device | str | None = None,
    progress: Progress | None = None,
) -> Rendering:
    """As :func:`render`, with about as few rays as give every picture a PSNR of ``quality_db``.

    Against the average over pixel and lens, sRGB.  Rays are traced in rounds, the first of 9 a
    pixel; what the rounds disagree by tells how many more it takes, and what is expected of each
    picture.  All rounds are in the pictures, (P, M, M, 3).

    Parameters
    ----------
    most_rays : the budget, rays a pixel.
    progress : called with (rays a pixel done, of those wanted as far as is known).

    Raises
    ------
    OpticsError : a plane that the lens cannot form, or a quality beyond the budget.
    DeviceError : no device, or none whose name fits.

    Source: docs/notebook/true-picture.md.
    """
    wanted = [SensorPlane.of(scene.camera)] if planes is None else list(planes)
    camera = _lens_for(scene, wanted)
    _check_quality(quality_db, most_rays)
    tracer = open_tracer(scene, device)
    quality = WantedQuality(tracer, camera, wanted, pixels, quality_db, most_rays)
    return quality.pictures(progress)


def _check_quality(quality_db: float, most_rays: float) -> None:
    if not (math.isfinite(quality_db) and quality_db > 0):
        raise OpticsError(f"must be a positive number of dB, not {quality_db}", key="quality")
    if not most_rays > 0:
        raise OpticsError(f"must be positive, not {most_rays:g}", key="most_rays")


def _lens_for(scene: Scene, planes: list[SensorPlane]) -> Camera:
    """The scene's camera, as wide open as any of ``planes``: the scene knows all light.

    Raises :class:`OpticsError` where there are none, or for one that the lens cannot form.
    """
    if not planes:
        raise OpticsError("no planes were asked for", key="planes")
    widest = min(plane.f_number for plane in planes)
    camera = replace(scene.camera, f_number=min(widest, scene.camera.f_number))
    for plane in planes:
        plane.check(Slab(camera, 1, 1))
        plane.lens_aperture(Slab(camera, 1, 1))
    return camera


def _nearest(
    tracer: Tracer, slab: Slab, planes: list[SensorPlane], progress: Progress | None
) -> np.ndarray:
    if len(planes) > 1:
        return trace_planes(tracer, slab, planes, progress=progress)
    return trace_picture(
        tracer, slab.camera, slab.pixels, planes[0], views=slab.views, progress=progress
    )[None]


def record(
    scene: Scene,
    path: str | Path,
    *,
    views: int | None = None,
    pixels: int = 256,
    depth_stream: bool | None = None,
    subpixels: float | None = None,
    lattice: str = "crossed",
    quality_db: float | None = None,
    focus_range_m: tuple[float, float] | None = None,
    most_rays: float = MOST_RAYS,
    focus_m: float | None = None,
    f_number: float | None = None,
    layout: str = AUTO,
    codec: str = "libx264",
    pixel_format: str = AUTO,
    crf: float | str = AUTO,
    preset: str | None = AUTO,
    device: Device | str | None = None,
    progress: Progress | None = None,
) -> LightField:
    """Trace a light field of a scene and store it as video (Algorithm 3): trace, encode, join.

    Parameters
    ----------
    path : the file to write, ``.mkv``; it appears when it is whole.
    views, pixels : N x N views of M x M pixels; N is 4, or 16 without ``depth_stream``.
    depth_stream : store the inverse depth of every ray as a stream of its own, and views of
        ``subpixels`` times M pixels (2 by default), so that few of them give pictures of M pixels
        by depth; default where ``views`` is not given.  At the bytes of 16 x 16 plain views, its
        pictures are 12 dB nearer to the true ones (docs/notebook/true-picture.md).
    lattice : of these views: ``crossed``, each displaced within a pixel against all others, which
        gains pictures by depth 2 dB, or ``plain``, which all other ways to read a file need.
    quality_db : instead of ``views`` and ``subpixels``, with a depth stream: what pictures of the
        whole lens are to have against the average over pixel and lens, before the codec's loss.  A
        pilot of a tenth of the rays says how many it takes; the file says what is expected.
    focus_range_m : nearest and farthest focus of these pictures; default what is seen.
    most_rays : the budget of a quality, rays a pixel.
    focus_m : metres, ``math.inf`` allowed; default the scene's.
    f_number : the widest that can be refocused later; default the scene's.
    layout : ``macropixels``, ``views``, or ``auto`` as measured best at that N and M.
    codec, pixel_format, crf, preset : as :func:`lfcore.storage.defaults.codec_spec` takes them.
    device : open, or part of its name.
    progress : called with (outer elements done, of all).

    Returns
    -------
    The light field, opened.

    Raises
    ------
    OpticsError : a lens that cannot be, or a quality beyond the budget.
    StorageError : settings that the codec does not take, or a file that cannot be written.
    DeviceError : no device, or none whose name fits.

    Source: thesis, Algorithm 3.
    """
    from lfcore.lightfield import LightField
    from lfcore.rendering.depth import depth_range
    from lfcore.rendering.record import record_slab
    from lfcore.rendering.record_depth import depth_store, record_by_depth

    camera = recorded_camera(scene.camera, focus_m, f_number)
    content = None
    if quality_db is not None:
        if depth_stream is False or views is not None or subpixels is not None:
            raise OpticsError(
                "chooses the rays itself, and stores their depths", key="quality",
                remedy="Leave out views, subpixels and depth_stream",
            )  # fmt: skip
        _check_quality(quality_db, most_rays)
        tracer, depth_stream = open_tracer(scene, device), True
        near_far = focus_range_m or depth_range(tracer, Slab(camera, STORED_COUNT.views, pixels))
        planes = planes_between(camera, *(near_far or (math.inf, math.inf)))
        planned = WantedQuality(tracer, camera, planes, pixels, quality_db, most_rays).plan()
        views, subpixels = planned.count.views, planned.count.subpixels
        focus = [plane.focus_m for plane in (planes[0], planes[-1])]
        content = {"expected": {"db": round(planned.expected_db, 2), "focus_m": focus}}
    by_depth, count = rays_to_store(depth_stream, views, subpixels)
    if by_depth:
        spec = codec_spec(
            count.views, codec, pixel_format=pixel_format, crf=crf, preset=preset, by_depth=True
        )
        kind = "views" if layout == AUTO else layout
        slab, store = depth_store(camera, count, pixels, spec, lattice=lattice, kind=kind)
        tracer = open_tracer(scene, device)
        record_by_depth(path, tracer, slab, store, content=content, progress=progress)
        return LightField.open(path)
    if subpixels is not None:
        raise OpticsError("belong to a depth stream", key="subpixels", remedy="Leave them out")
    slab = Slab(camera, count.views, pixels)
    spec = codec_spec(count.views, codec, pixel_format=pixel_format, crf=crf, preset=preset)
    frames = frame_layout(count.views, pixels, spec.pixel_format, kind=layout)
    record_slab(path, open_tracers(scene, device), slab, frames, spec, progress=progress)
    return LightField.open(path)


def rays_to_store(
    depth_stream: bool | None, views: int | None, subpixels: float | None
) -> tuple[bool, RayCount]:
    """Whether :func:`record` stores depth beside the views, and the rays of a pixel it traces."""
    if depth_stream or (depth_stream is None and views is None):
        usual = STORED_COUNT
        count = usual.views if views is None else views
        return True, RayCount(count, usual.subpixels if subpixels is None else subpixels)
    return False, RayCount(VIEWS if views is None else views, 1)


def recorded_camera(camera: Camera, focus_m: float | None, f_number: float | None) -> Camera:
    """The camera with another focus or lens; the extent of its picture stays.

    Raises :class:`OpticsError` for a focus inside the focal length or a picture without extent.
    """
    found = focused_camera(camera, SensorPlane.of(camera, focus_m, f_number))
    if not np.isfinite(found.field_width):
        raise OpticsError("the picture has no extent", key="focus_m")
    return found


def trace_array(
    scene: Scene,
    array: CameraArray | None = None,
    samples_per_pixel: int | None = None,
    *,
    instants: int | None = None,
    device: Device | str | None = None,
    progress: Progress | None = None,
) -> np.ndarray:
    """Pictures of parallel pinhole cameras on a grid, side by side: the light field camera.

    Parameters
    ----------
    array : the cameras, in the scene's camera space; default what the scene's own film asks for
        (``Camera "lightfield"`` of pbrt, or ``camera.lightfield`` of a scene.yaml).
    samples_per_pixel : rays a pixel; default the film's, or 1.
    instants : of the shutter while objects move; default 1 at rest, else up to 16.
    progress : called with (instants done, of all).

    Returns
    -------
    (Ny h, Nx w, 3) float32, linear radiance, not clamped; the array of the scene's own film is
    ``scene.view.array``.

    Raises
    ------
    OpticsError : neither an array nor a film, or no samples.
    DeviceError : no device, or none whose name fits.

    Source: CS348b's third assignment; pbrt's light field camera.
    """
    from lfcore.rendering.photograph import photograph
    from lfcore.rendering.shutter import trace_shutter

    if array is None:
        return photograph(
            scene, samples_per_pixel, instants, device=opened(device), progress=progress
        )
    return trace_shutter(
        scene, array, 1 if instants is None else instants,
        1 if samples_per_pixel is None else samples_per_pixel,
        device=opened(device), progress=progress,
    )  # fmt: skip
