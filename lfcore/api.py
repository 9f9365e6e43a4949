"""What the library does, one function each: scenes from files, pictures and light fields of them.

Distances are metres, pictures float32 arrays of linear light, rows from the top.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lfcore.errors import OpticsError, check_kind, check_known
from lfcore.opencl.device import Device
from lfcore.optics.array import CameraArray
from lfcore.optics.camera import Camera
from lfcore.optics.focus import exclude_twice
from lfcore.optics.planes import SensorPlane, check_keywords
from lfcore.optics.size import Pixels, Size, whole_number
from lfcore.optics.slab import Lattice, Slab
from lfcore.progress import Progress
from lfcore.readers.load import load_scene as load_scene
from lfcore.rendering.by_depth import pictures_by_depth
from lfcore.rendering.direct import focused_camera, trace_picture, trace_planes
from lfcore.rendering.prepared import lit, open_tracer, open_tracers, opened
from lfcore.rendering.quality import Quality, QualitySearch, Rendering, planes_between
from lfcore.scene.baked import BakeOptions
from lfcore.scene.description import check
from lfcore.scene.model import Scene
from lfcore.scene.sky import with_sky
from lfcore.storage.codecs import Encoding
from lfcore.storage.defaults import chosen_encoding, frame_layout
from lfcore.tracing.tracer import Tracer

if TYPE_CHECKING:
    from lfcore.lightfield import LightField

FILTERS = ("depth", "nearest")
OF_LENS = ("focus_at", "blur")
"""Settings of :meth:`Scene.plane` that stand for a focus and an f-number."""
VIEWS = 16
"""The default lens samples per side where rays count in the pixel that they fall on."""
# Video and exposure are imported by the functions that need them: a picture is there sooner.


def bake(
    scene: Scene,
    *,
    sky: Mapping[str, Any] | None = None,
    bounces: int | None = None,
    error: float | None = None,
    cells: int | None = None,
    mib: int | None = None,
    device: Device | str | None = None,
    progress: Progress | None = None,
) -> Scene:
    """Bake the light of a sky, of glowing surfaces and of all bounces between matt surfaces.

    What reaches a matt surface does not depend on the viewer: it is computed once, and every ray
    reads it.  :func:`render` and :func:`record` bake scenes that ask for it, if they are not baked.

    Parameters
    ----------
    scene : Scene
        What :func:`load_scene` returns.
    sky : mapping, optional
        As ``sky`` of a scene.yaml, upright before the camera.  Default: the scene's, if any.
    bounces : int, optional
        Default: the scene's, or 3.
    error : float, optional
        The root mean square error, a share of the light, where the camera sees it.
        Default: the scene's, or 0.02.
    cells : int, optional
        Cells over the width of the picture on which light is kept to begin with; small shadows
        need more.  Default: the scene's, or 32.
    mib : int, optional
        Memory that this may use, MiB.  Default: the scene's, or 1024.
    device, progress : optional
        As in :func:`render`.

    Returns
    -------
    Scene
        The scene with its ``light``, which has the expected error.

    Raises
    ------
    SceneError
        No such sky, a setting out of range, or a material that reflects more than it gets.
    DeviceError
        There is no device, or none of that name.

    Notes
    -----
    Source: docs/notebook/true-picture.md.
    """
    _check_scene(scene)
    asked: dict[str, Any] = {
        "bounces": bounces, "bake_error": error, "bake_cells": cells, "bake_mib": mib, "sky": sky,
    }  # fmt: skip
    given = {name: value for name, value in asked.items() if value is not None}
    check({"objects": [{"file": "-"}], **given}, file=scene.name)
    options = {key.removeprefix("bake_"): value for key, value in given.items() if key != "sky"}
    scene = replace(scene, bake=replace(scene.bake or BakeOptions(), **options), light=None)
    if sky is not None:
        upright = np.diag([1.0, -1.0, -1.0])
        scene = with_sky(scene, dict(sky), upright, file=scene.name)
    return lit(scene, opened(device), progress)


def render(
    scene: Scene,
    focus_m: float | str | None = None,
    f_number: float | None = None,
    *,
    planes: Sequence[SensorPlane] | None = None,
    pixels: Pixels = 256,
    views: int | Lattice | None = None,
    filter: str = "depth",
    quality: Quality | None = None,
    device: Device | str | None = None,
    progress: Progress | None = None,
    **more: Any,
) -> np.ndarray:
    """Render pictures of a scene through its lens, without storing a light field.

    Parameters
    ----------
    scene : Scene
        What :func:`load_scene` returns.
    focus_m : float or str, optional
        Focus distance in metres, ``math.inf`` allowed; ``"near"``, ``"middle"``, ``"far"`` or
        ``"40%"`` of the depth that is seen.  Default: the scene's.
    f_number : float, optional
        Default: the scene's.
    planes : sequence of SensorPlane, optional
        Several pictures from the same rays, instead of focus and aperture; see
        :meth:`Scene.plane`.
    pixels : int or (int, int)
        The side of square pictures, or width and height.  The camera's field is that of the shorter
        side.
    views : int or Lattice, optional
        Lens samples per side, with 2 x 2 rays per pixel each, or the whole lattice.  Default: 4;
        with the filter ``nearest`` 16, with 1 ray per pixel each.
    filter : str
        ``depth`` spreads a ray over the part of the picture that its part of lens and pixel sweeps
        at the ray's depth.  With ``nearest`` a ray counts in the pixel that it falls on
        (Algorithm 1), and views are not displaced.
    quality : Quality, optional
        Choose the rays for a quality, instead of ``views``; see :func:`render_to_quality`.
    device : Device or str, optional
        An open device, or part of its name.
    progress : callable, optional
        Called with (done, of all), first while light is baked, for a scene that asks for that.
    **more
        Other settings of :meth:`Scene.plane`, such as ``blur`` and ``focus_at``.

    Returns
    -------
    ndarray
        (height, width, 3) float32, linear light; with ``planes`` (P, height, width, 3).  A single
        picture is traced at its own focus.

    Raises
    ------
    OpticsError
        The lens cannot form a plane, the filter is unknown, or it does not take these rays.
    DeviceError
        There is no device, or none of that name.

    Notes
    -----
    Source: docs/notebook/true-picture.md; thesis, Algorithm 1 and section 6.3.2.
    """
    check_keywords("render", more, ("aperture", *OF_LENS))
    _check_scene(scene)
    size = Size.of(pixels)
    if quality is not None:
        if views is not None or filter != "depth":
            problem = "chooses the rays itself, for the filter 'depth'"
            raise OpticsError(problem, key="quality", remedy="Leave out views and filter")
        found = render_to_quality(
            scene, quality, focus_m, f_number, planes=planes, pixels=size, device=device,
            progress=progress, **more,
        ).pictures  # fmt: skip
        return found[0] if planes is None else found
    lattice = lattice_to_trace(filter, views)
    wanted, camera = _wanted(scene, planes, size, focus_m=focus_m, f_number=f_number, **more)
    tracer = open_tracer(scene, device, progress)
    coarse = [replace(plane, pixels=size.longer) for plane in wanted]
    if filter == "depth":
        made = pictures_by_depth(tracer, camera, wanted, size, lattice, progress=progress)
    elif len(wanted) > 1:
        made = trace_planes(tracer, Slab.of(camera, lattice, size), coarse, progress=progress)
    else:
        one = trace_picture(tracer, camera, size, coarse[0], views=lattice, progress=progress)
        made = one[None]
    return made[0] if planes is None else made


def _check_scene(scene: object) -> None:
    check_kind(scene, Scene, "scene", remedy="Read one with load_scene")


def lattice_to_trace(filter: str, views: int | Lattice | None) -> Lattice:
    """The lattice that :func:`render` traces."""
    check_known(OpticsError, "filter", filter, FILTERS)
    if filter == "depth":
        return views if isinstance(views, Lattice) else Lattice(4 if views is None else views)
    remedy = "Give a Lattice with displaced=False"
    return _plain(views, "the filter 'nearest' takes views that are not displaced", remedy)


def _plain(views: int | Lattice | None, problem: str, remedy: str) -> Lattice:
    """Views that are not displaced, by default with one ray per pixel."""
    if not isinstance(views, Lattice):
        return Lattice(VIEWS if views is None else views, 1, displaced=False)
    if views.displaced:
        raise OpticsError(problem, key="views", remedy=remedy)
    return views


def render_to_quality(
    scene: Scene,
    quality: Quality,
    focus_m: float | str | None = None,
    f_number: float | None = None,
    *,
    planes: Sequence[SensorPlane] | None = None,
    pixels: Pixels = 256,
    device: Device | str | None = None,
    progress: Progress | None = None,
    **more: Any,
) -> Rendering:
    """Render as :func:`render`, with about as few rays as every picture needs for a quality.

    One view predicts the error of any lattice of rays; the cheapest that reaches the quality is
    traced.

    Parameters
    ----------
    quality : Quality
        The PSNR and the budget.  Its ``focus_range_m`` belongs to :func:`record`.
    scene, focus_m, f_number, planes, pixels, device, progress, **more
        As in :func:`render`.

    Returns
    -------
    Rendering
        The pictures (P, height, width, 3), their rays and their expected errors.

    Raises
    ------
    OpticsError
        The lens cannot form a plane, or the quality is beyond the budget.
    DeviceError
        There is no device, or none of that name.

    Notes
    -----
    Source: docs/notebook/true-picture.md.
    """
    _check_scene(scene)
    check_kind(quality, Quality, "quality")
    if quality.focus_range_m is not None:
        raise OpticsError("belongs to a light field", key="focus_range_m", remedy="Give planes")
    size = Size.of(pixels)
    wanted, camera = _wanted(scene, planes, size, focus_m=focus_m, f_number=f_number, **more)
    tracer = open_tracer(scene, device, progress)
    return QualitySearch(tracer, camera, wanted, size, quality).pictures(progress)


def _wanted(
    scene: Scene, planes: Sequence[SensorPlane] | None, size: Size, **asked: Any
) -> tuple[list[SensorPlane], Camera]:
    """The planes, and the scene's camera with their widest aperture, as it knows all its light."""
    if planes is None:
        planes = [scene.plane(pixels=size, **asked)]
    else:
        for name, value in asked.items():
            exclude_twice(**{name: value, "planes": planes})
    check_kind(planes, Sequence, "planes", "a sequence of SensorPlanes")
    if not planes:
        raise OpticsError("no planes were asked for", key="planes")
    for plane in planes:
        check_kind(plane, SensorPlane, "planes")
    widest = min(plane.f_number for plane in planes)
    camera = replace(scene.camera, f_number=min(widest, scene.camera.f_number))
    for plane in planes:
        plane.check(Slab(camera, 1, 1))
        plane.lens_aperture(Slab(camera, 1, 1))
    return list(planes), camera


def record(
    scene: Scene,
    path: str | Path,
    *,
    views: int | Lattice | None = None,
    pixels: Pixels = 256,
    focus_m: float | str | None = None,
    f_number: float | None = None,
    quality: Quality | None = None,
    encoding: Encoding | None = None,
    device: Device | str | None = None,
    progress: Progress | None = None,
    **more: Any,
) -> LightField:
    """Record a light field of a scene as video (Algorithm 3): trace, encode, join.

    By default the file holds 4 x 4 views of twice the pixels, and the inverse depth of every ray.
    Pictures are then sliced by depth: at the bytes of 16 x 16 plain views they are 12 dB nearer to
    the true ones (docs/notebook/true-picture.md).  Views between the recorded ones are made by
    depth, too.

    All views of a pinhole are the same.  Where the scene's camera is one, a lens is fitted as for a
    mesh without a camera, and the file says so in ``content["lens"]``.

    Parameters
    ----------
    scene : Scene
        What :func:`load_scene` returns.
    path : str or Path
        The file to write, ``.mkv``; it appears when it is whole.
    views : int or Lattice, optional
        A number N is of the views that the file gives, to exports and the like: N x N.  By depth
        it stores fewer, 4 x 4 up to N = 16 and the root of N beyond.  A :class:`Lattice` is stored
        as it is.  With ``encoding.depth=False`` N x N views are stored as they are, without depth;
        16 x 16 by default.
    pixels : int or (int, int)
        As in :func:`render`, of the pictures that the file is for.
    focus_m : float or str, optional
        As in :func:`render`.
    f_number : float, optional
        The widest aperture that can be refocused later.  Default: the scene's.
    quality : Quality, optional
        Choose rays and rate factor for a quality of pictures through the whole lens, instead of
        ``views``.  One view predicts the rays that are needed, small light fields what the codec
        loses; the file has the prediction in ``content["expected"]``.
    encoding : Encoding, optional
        Codec, layout and whether depth is stored.  Default: as measured best.
    device, progress : optional
        As in :func:`render`.
    **more
        ``focus_at`` and ``blur`` of :meth:`Scene.plane`.

    Returns
    -------
    LightField
        The file, opened.

    Raises
    ------
    OpticsError
        An impossible lens, or a quality beyond the budget.
    StorageError
        The codec does not take the settings, or the file cannot be written.
    DeviceError
        There is no device, or none of that name.

    Notes
    -----
    Source: thesis, Algorithm 3.
    """
    from lfcore.lightfield import LightField
    from lfcore.rendering.record import peak_to_store, record_slab
    from lfcore.rendering.record_depth import depth_store, record_by_depth

    check_keywords("record", more, OF_LENS, ())
    _check_scene(scene)
    check_kind(quality, Quality | None, "quality", "a Quality")
    check_kind(encoding, Encoding | None, "encoding", "an Encoding")
    size = Size.of(pixels)
    scene, camera, content = recorded_lens(scene, size, focus_m, f_number, **more)
    encoding = encoding or Encoding()
    tracer = open_tracer(scene, device, progress)
    peak = peak_to_store(tracer, Slab.of(camera, 4, size), encoding.transfer)
    encoding = replace(encoding, transfer="pq" if peak else "srgb")
    if quality is not None:
        if encoding.depth is False or views is not None:
            problem = "chooses the rays itself, and stores their depths"
            raise OpticsError(problem, key="quality", remedy="Leave out views and depth")
        views, encoding, content["expected"] = _planned(
            tracer, camera, size, quality, encoding, peak
        )
    by_depth, lattice = lattice_to_store(encoding.depth, views)
    if by_depth and views is not None and not isinstance(views, Lattice):
        content["views"] = int(views)
    width = Slab.of(camera, lattice, size).size.width
    spec = chosen_encoding(lattice.views, encoding, by_depth=by_depth, width=width)
    if by_depth:
        kind = encoding.layout or "views"
        slab, store = depth_store(camera, lattice, size, spec, kind=kind, peak=peak)
        record_by_depth(path, tracer, slab, store, content=content, progress=progress)
    else:
        slab = Slab.of(camera, lattice, size)
        frames = frame_layout(
            slab.views, slab.size, spec.stored_format, kind=encoding.layout, peak=peak
        )
        tracers = open_tracers(scene, device)
        record_slab(path, tracers, slab, frames, spec, content=content, progress=progress)
    return LightField.open(path)


def recorded_lens(
    scene: Scene,
    pixels: Pixels,
    focus_m: float | str | None = None,
    f_number: float | None = None,
    **more: Any,
) -> tuple[Scene, Camera, dict[str, Any]]:
    """The scene, the camera that :func:`record` traces, and what the file says of its lens.

    A pinhole gets a lens unless one is asked for: all its views are the same. The extent of the
    picture stays.
    """
    content = {}
    if f_number is None and more.get("blur") is None and scene.is_pinhole:
        scene, content = scene.with_lens(), {"lens": "fitted: the scene's camera is a pinhole"}
    camera = focused_camera(scene.camera, scene.plane(focus_m, f_number, pixels=pixels, **more))
    if not np.isfinite(camera.field_width):
        raise OpticsError("the picture has no extent", key="focus_m")
    return scene, camera, content


def _planned(
    tracer: Tracer,
    camera: Camera,
    size: Size,
    quality: Quality,
    encoding: Encoding,
    peak: float | None,
) -> tuple[Lattice, Encoding, dict]:
    """The lattice that one view chooses, the encoding that trials choose, and what the file says of
    its quality."""
    from lfcore.rendering.depth import seen_range
    from lfcore.rendering.trials import OF_RAYS, Trials, share_db, together_db

    near_far = quality.focus_range_m or seen_range(tracer, Slab.of(camera, 4, size))
    planes = planes_between(camera, *(near_far or (math.inf, math.inf)))
    codec_takes = encoding.crf is None and not encoding.lossless
    search = QualitySearch(tracer, camera, planes, size, quality)
    lattice = search.plan(share_db(0.0, OF_RAYS) if codec_takes else 0.0)
    rays_db = float(search.look.expected_db(lattice.views, lattice.subpixels).min())
    width = Slab.of(camera, lattice, size).size.width
    spec = chosen_encoding(lattice.views, encoding, by_depth=True, width=width)
    found = {"focus_m": [planes[0].focus_m, planes[-1].focus_m]}
    if encoding.lossless:
        return lattice, encoding, found | {"db": round(rays_db, 2)}
    trials = Trials(tracer, camera, lattice, size, planes, spec, peak)
    if encoding.crf is None:
        crf, codec_db = trials.chosen(share_db(quality.quality_db, 1 - OF_RAYS))
        encoding = replace(encoding, crf=crf)
    else:
        codec_db = trials.codec_db(encoding.crf)
    db = together_db(rays_db, codec_db)
    return lattice, encoding, found | {"db": round(db, 2), "codec_db": round(codec_db, 2)}


def lattice_to_store(depth: bool | None, views: int | Lattice | None) -> tuple[bool, Lattice]:
    """Whether :func:`record` stores depth, and the lattice that it traces."""
    if depth is not False:
        if isinstance(views, Lattice):
            return True, views
        # Views between them are made by depth: 36 to 47 dB from 4 x 4, 0.7 dB more from 6 x 6.
        served = whole_number("views", 4 if views is None else views, 4096)
        return True, Lattice(max(4, math.isqrt(served)))
    remedy = "Store depth, or give a Lattice with displaced=False"
    return False, _plain(views, "displaced views need their depths", remedy)


def trace_array(
    scene: Scene,
    array: CameraArray | None = None,
    samples_per_pixel: int | None = None,
    *,
    instants: int | None = None,
    device: Device | str | None = None,
    progress: Progress | None = None,
) -> np.ndarray:
    """Trace parallel pinhole cameras on a grid, side by side in one picture: a light field camera.

    Parameters
    ----------
    scene : Scene
        What :func:`load_scene` returns.
    array : CameraArray, optional
        The cameras, in the scene's camera space.  Default: those of the scene's own film
        (``Camera "lightfield"`` of pbrt, or ``camera.lightfield`` of a scene.yaml).
    samples_per_pixel : int, optional
        Rays per pixel.  Default: the film's, or 1.
    instants : int, optional
        Instants of the shutter while objects move.  Default: 1 at rest, else up to 16.
    device, progress : optional
        As in :func:`render`.

    Returns
    -------
    ndarray
        (Ny h, Nx w, 3) float32, linear radiance, not clamped; for
        :meth:`LightField.from_views`.  The array of the scene's own film is ``scene.view.array``.

    Raises
    ------
    OpticsError
        Neither an array nor a film, or no samples.
    DeviceError
        There is no device, or none of that name.

    Notes
    -----
    Source: CS348b's third assignment; pbrt's light field camera.
    """
    from lfcore.rendering.photograph import photograph, trace_shutter

    _check_scene(scene)
    if array is None:
        return photograph(
            scene, samples_per_pixel, instants, device=opened(device), progress=progress
        )
    return trace_shutter(
        scene, array, 1 if instants is None else instants,
        1 if samples_per_pixel is None else samples_per_pixel,
        device=opened(device), progress=progress,
    )  # fmt: skip
