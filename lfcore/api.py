"""One function per task: read a scene, bake its light, render pictures, record a light field.

Distances are in metres.  Pictures are float32 arrays of linear light, rows from the top.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from lfcore.errors import OpticsError, check_kind, suggest_keywords
from lfcore.opencl.device import Device
from lfcore.optics.array import CameraArray
from lfcore.optics.planes import SensorPlane, refuse_lens
from lfcore.optics.size import Pixels, Size
from lfcore.optics.slab import Lattice, Slab
from lfcore.pictures import LIGHT_FIELD, check_suffix
from lfcore.progress import Progress
from lfcore.readers.load import load_scene as load_scene
from lfcore.rendering.by_depth import pictures_by_depth
from lfcore.rendering.defaults import (
    chosen_planes,
    lattice_to_trace,
    recorded_lens,
)
from lfcore.rendering.direct import trace_picture, trace_planes
from lfcore.rendering.prepared import lit, open_tracer, opened
from lfcore.rendering.quality import Quality, QualitySearch, Rendering
from lfcore.scene.baked import BakeOptions
from lfcore.scene.description import check
from lfcore.scene.model import Scene
from lfcore.scene.sky import with_sky
from lfcore.storage.codecs import Encoding

if TYPE_CHECKING:
    from lfcore.lightfield import LightField

# Functions that need video import it themselves, so that a picture starts sooner.


@suggest_keywords
def bake(
    scene: Scene,
    *,
    sky: Mapping[str, Any] | None = None,
    bounces: int | Literal["all"] | None = None,
    error: float | None = None,
    cells: int | None = None,
    mib: int | None = None,
    device: Device | str | None = None,
    progress: Progress | None = None,
) -> Scene:
    """Bake the light of a sky, of emitters and of all bounces between matt surfaces.

    The irradiance of a matt surface does not depend on the viewer: it is computed once, and every
    ray reads it.  :func:`render` and :func:`record` bake a scene with ``bake`` options themselves.

    Parameters
    ----------
    scene : Scene
        From :func:`load_scene` or :meth:`Scene.from_triangles`.
    sky : mapping, optional
        As ``sky`` in a scene.yaml, upright before the camera.  Default: the scene's, if any.
    bounces : int or "all", optional
        Default: the scene's, or all: until further ones change less than ``error``.
    error : float, optional
        The root mean square error in the picture, relative to the light.
        Default: the scene's, or 0.02.
    cells : int, optional
        First cells of the irradiance cache per picture width; small shadows need more.
        Default: the scene's, or 32.
    mib : int, optional
        The memory that baking may use, MiB.  Default: the scene's, or 1024.
    device, progress : optional
        As in :func:`render`.

    Returns
    -------
    Scene
        The scene with its ``light``, which holds the expected error.

    Raises
    ------
    SceneError
        The sky is missing, a setting is out of range, or a material reflects more than it receives.
    DeviceError
        No device has that name, or there is none.

    Notes
    -----
    Source: docs/decisions.md.

    Examples
    --------
    >>> daylight = lfcore.bake(scene, sky={"colour": "#8090ff"}, bounces=1, error=0.2)
    >>> daylight.light.values.dtype
    dtype('float32')
    """
    _check_scene(scene)
    keys: dict[str, Any] = {
        "bounces": bounces, "bake_error": error, "bake_cells": cells, "bake_mib": mib, "sky": sky,
    }  # fmt: skip
    changes = {key: value for key, value in keys.items() if value is not None}
    check({"objects": [{"file": "-"}], **changes}, file=scene.name)
    options = {key.removeprefix("bake_"): value for key, value in changes.items() if key != "sky"}
    scene = replace(scene, bake=replace(scene.bake or BakeOptions(), **options), light=None)
    if sky is not None:
        upright = np.diag([1.0, -1.0, -1.0])
        scene = with_sky(scene, dict(sky), upright, file=scene.name)
    return lit(scene, opened(device), progress)


@suggest_keywords
def render(
    scene: Scene,
    focus_m: float | str | None = None,
    f_number: float | None = None,
    *,
    aperture: str = "circle",
    focus_at: Sequence[float] | None = None,
    blur: float | str | None = None,
    planes: Sequence[SensorPlane] | None = None,
    pixels: Pixels = 256,
    views: int | Lattice | None = None,
    filter: str = "depth",
    quality: Quality | None = None,
    device: Device | str | None = None,
    progress: Progress | None = None,
) -> np.ndarray:
    """Render pictures of a scene through its lens, without storing a light field.

    Parameters
    ----------
    scene : Scene
        As in :func:`bake`.
    focus_m, f_number, aperture, focus_at, blur : optional
        As in :meth:`Scene.plane`: a distance in metres or ``"near"``, ``"middle"``, ``"far"``, and
        an f-number.  Default: the scene's.
    planes : sequence of SensorPlane, optional
        Instead of focus and aperture: several pictures from the same rays; see
        :meth:`Scene.plane`, which has more settings.
    pixels : int or (int, int)
        The side of square pictures, or width and height.  The camera's field of view is that of
        the shorter side.
    views : int or Lattice, optional
        Lens samples per side, each with 2 x 2 rays per pixel, or the whole lattice.  Default: 4;
        with the filter ``nearest`` 16, each with 1 ray per pixel.
    filter : str
        ``depth`` spreads each ray over the area of the picture that its share of lens and pixel
        covers at the ray's depth.  ``nearest`` counts each ray in the pixel that it hits
        (Algorithm 1), and needs views that are not displaced.
    quality : Quality, optional
        Choose the rays for a quality, instead of ``views``; see :func:`render_to_quality`.
    device : Device or str, optional
        An open device, or part of its name.
    progress : callable, optional
        Called with (done, total): first while light is baked, for a scene with ``bake`` options.

    Returns
    -------
    ndarray
        (height, width, 3) float32, linear light; with ``planes`` (P, height, width, 3).

    Raises
    ------
    OpticsError
        The lens cannot form a plane, or the filter is unknown or does not suit the lattice.
    DeviceError
        No device has that name, or there is none.

    Notes
    -----
    Source: docs/decisions.md; thesis, Algorithm 1 and section 6.3.2.

    Examples
    --------
    >>> picture = lfcore.render(scene, focus_m="near", f_number=4, pixels=(24, 16), views=2)
    >>> picture.shape, picture.dtype
    ((16, 24, 3), dtype('float32'))
    >>> planes = [scene.plane("near"), scene.plane("far", blur="2%")]
    >>> lfcore.render(scene, planes=planes, pixels=16, views=2).shape
    (2, 16, 16, 3)
    """
    _check_scene(scene)
    size = Size.of(pixels)
    if quality is not None:
        if views is not None or filter != "depth":
            problem = "chooses the rays itself, for the filter 'depth'"
            raise OpticsError(problem, key="quality", remedy="Leave out views and filter")
        pictures = render_to_quality(
            scene, quality, focus_m, f_number, aperture=aperture, focus_at=focus_at, blur=blur,
            planes=planes, pixels=size, device=device, progress=progress,
        ).pictures  # fmt: skip
        return pictures[0] if planes is None else pictures
    if filter != "depth":
        _refuse_shutter(scene, "the filter 'nearest'")
    lattice = lattice_to_trace(filter, views)
    chosen, camera = chosen_planes(
        scene, planes, size, focus_m=focus_m, f_number=f_number, aperture=aperture,
        focus_at=focus_at, blur=blur,
    )  # fmt: skip
    if filter != "depth":
        refuse_lens(chosen, "the filter 'nearest'", "Use the filter depth")
    tracer = open_tracer(scene, device, progress, by_depth=filter == "depth")
    by_side = [replace(plane, pixels=size.longer) for plane in chosen]
    if filter == "depth":
        pictures = pictures_by_depth(tracer, camera, chosen, size, lattice, progress=progress)
    elif len(chosen) > 1:
        pictures = trace_planes(tracer, Slab.of(camera, lattice, size), by_side, progress=progress)
    else:
        traced = trace_picture(tracer, camera, size, by_side[0], views=lattice, progress=progress)
        pictures = traced[None]
    return pictures[0] if planes is None else pictures


def _refuse_shutter(scene: Scene, what: str) -> None:
    """Raise :class:`OpticsError` for an open shutter."""
    if scene.shutter:
        problem, remedy = f"is open for a while, which {what} does not show", "Give an instant"
        raise OpticsError(problem, key="shutter", remedy=remedy)


def _check_scene(scene: object) -> None:
    check_kind(scene, Scene, "scene", remedy="Read one with load_scene")


@suggest_keywords
def render_to_quality(
    scene: Scene,
    quality: Quality,
    focus_m: float | str | None = None,
    f_number: float | None = None,
    *,
    aperture: str = "circle",
    focus_at: Sequence[float] | None = None,
    blur: float | str | None = None,
    planes: Sequence[SensorPlane] | None = None,
    pixels: Pixels = 256,
    device: Device | str | None = None,
    progress: Progress | None = None,
) -> Rendering:
    """Render like :func:`render`, with the fewest rays that reach a quality in every picture.

    One traced view predicts the error of every lattice; the cheapest lattice that reaches the
    quality is traced.

    Parameters
    ----------
    quality : Quality
        The PSNR and the budget, without ``focus_range_m``, which is for :func:`record`.
    scene, focus_m, f_number, aperture, focus_at, blur, planes, pixels, device, progress
        As in :func:`render`.

    Returns
    -------
    Rendering
        The pictures (P, height, width, 3), their rays and their expected errors.

    Raises
    ------
    OpticsError
        The lens cannot form a plane, or the budget is too small for the quality.
    DeviceError
        No device has that name, or there is none.

    Notes
    -----
    Source: docs/decisions.md.

    Examples
    --------
    >>> made = lfcore.render_to_quality(scene, lfcore.Quality(20), pixels=24)
    >>> made.pictures.shape, bool(made.expected_db[0] >= 20)
    ((1, 24, 24, 3), True)
    """
    _check_scene(scene)
    check_kind(quality, Quality, "quality")
    if quality.focus_range_m is not None:
        problem = "is a setting of record"
        raise OpticsError(problem, key="focus_range_m", remedy="Give planes")
    size = Size.of(pixels)
    chosen, camera = chosen_planes(
        scene, planes, size, focus_m=focus_m, f_number=f_number, aperture=aperture,
        focus_at=focus_at, blur=blur,
    )  # fmt: skip
    refuse_lens(chosen, "a quality, which is that of a perfect lens,", "Give views, or a Lattice")
    tracer = open_tracer(scene, device, progress, by_depth=True)
    return QualitySearch(tracer, camera, chosen, size, quality).pictures(progress)


@suggest_keywords
def record(
    scene: Scene,
    path: str | Path,
    *,
    views: int | Lattice | None = None,
    pixels: Pixels = 256,
    focus_m: float | str | None = None,
    f_number: float | None = None,
    focus_at: Sequence[float] | None = None,
    blur: float | str | None = None,
    quality: Quality | None = None,
    encoding: Encoding | None = None,
    times: Sequence[float] | None = None,
    bake_each: bool = False,
    device: Device | str | None = None,
    progress: Progress | None = None,
) -> LightField:
    """Record a light field of a scene as video (Algorithm 3): trace, encode, join.

    By default the file holds 4 x 4 views of twice the pixels, and the inverse depth of every ray.
    Depth gives 12 dB better pictures than 16 x 16 plain views in the same number of bytes, and
    views between the recorded ones (docs/decisions.md).

    All views of a pinhole camera are the same.  Such a scene gets a fitted lens, like a mesh
    without a camera, and ``content["lens"]`` of the file says so.

    Parameters
    ----------
    scene : Scene
        As in :func:`bake`.
    path : str or Path
        The file to write, ``.mkv``; it appears when it is whole.
    views : int or Lattice, optional
        N: the file provides N x N views.  With depth it stores fewer views and makes the others:
        4 x 4 up to N = 16, then the square root of N per side.  With ``encoding.depth=False`` it
        stores all N x N; default 16.  A :class:`Lattice` is stored as it is.
    pixels : int or (int, int)
        The size of pictures that the file is made for, as in :func:`render`.
    focus_m, f_number, focus_at, blur : optional
        As in :meth:`Scene.plane`; no picture can have a wider aperture later.
    quality : Quality, optional
        Choose rays and rate factor for a quality of pictures through the whole lens, instead of
        ``views``.  One traced view predicts the error of each lattice, small light fields predict
        the codec's error, of a film at its middle instant.  ``content["expected"]`` of the file has
        the prediction.
    encoding : Encoding, optional
        Codec, layout and whether depth is stored.  Default: the best measured ones.
    times : sequence of float, optional
        Record a film: the scene at these instants, in seconds, in one file; see
        :meth:`LightField.at`.  A record that is killed continues when it is called again.
    bake_each : bool
        Bake the light of a film's every instant.  Default: as the scene stands.
    device, progress : optional
        As in :func:`render`.

    Returns
    -------
    LightField
        The file, opened; of a film its first instant.

    Raises
    ------
    OpticsError
        The lens is impossible, or the budget is too small for the quality.
    StorageError
        The codec refuses the settings, or the file cannot be written.
    DeviceError
        No device has that name, or there is none.

    Notes
    -----
    Source: thesis, Algorithm 3.

    Examples
    --------
    >>> field = lfcore.record(scene, "ball.mkv", views=9, pixels=16, f_number=2)
    >>> field.views_to_serve, field.grid
    (9, (4, 4))
    >>> field.refocus(focus_m="far").shape
    (16, 16, 3)
    """
    from lfcore.lightfield import LightField
    from lfcore.rendering.recording import Recording

    check_suffix(path, (LIGHT_FIELD,))
    _check_scene(scene)
    check_kind(quality, Quality | None, "quality", "a Quality")
    check_kind(encoding, Encoding | None, "encoding", "an Encoding")
    size, encoding = Size.of(pixels), encoding or Encoding()
    scene, camera, content = recorded_lens(
        scene, size, focus_m, f_number, focus_at=focus_at, blur=blur
    )
    if encoding.depth is False:
        _refuse_shutter(scene, "a file without depth")
    if bake_each:
        _refuse_shutter(scene, "light that is baked for each instant")
    if scene.shutter:
        content["shutter_s"] = list(scene.shutter)
    recording = Recording(path, scene, camera, size, views, encoding, content, device, progress)
    if times is None:
        recording.once(quality)
    else:
        recording.film(times, quality, bake_each=bake_each)
    return LightField.open(path)


@suggest_keywords
def trace_array(
    scene: Scene,
    array: CameraArray | None = None,
    samples_per_pixel: int | None = None,
    *,
    instants: int | None = None,
    device: Device | str | None = None,
    progress: Progress | None = None,
) -> np.ndarray:
    """Trace parallel pinhole cameras on a grid, a light field camera, side by side in one picture.

    Parameters
    ----------
    scene : Scene
        As in :func:`bake`.
    array : CameraArray, optional
        The cameras, in the scene's camera space.  Default: those of the scene's own film
        (``Camera "lightfield"`` of pbrt, or ``camera.lightfield`` of a scene.yaml).
    samples_per_pixel : int, optional
        Rays per pixel.  Default: the film's, or 1.
    instants : int, optional
        Instants of the open shutter, for moving objects.  Default: 1 at rest, else up to 16.
    device, progress : optional
        As in :func:`render`.

    Returns
    -------
    ndarray
        (Ny h, Nx w, 3) float32, linear radiance, not clamped; :meth:`LightField.from_views`
        stores it.  The array of the scene's own film is ``scene.view.array``.

    Raises
    ------
    OpticsError
        There is neither an array nor a film, or the samples are out of range.
    DeviceError
        No device has that name, or there is none.

    Notes
    -----
    Source: CS348b's third assignment; pbrt's light field camera.

    Examples
    --------
    >>> array = lfcore.CameraArray.on_grid((3, 2), (-0.1, 0.1, -0.05, 0.05), 45.0, (16, 12))
    >>> lfcore.trace_array(scene, array).shape
    (24, 48, 3)
    """
    from lfcore.rendering.photograph import photograph, trace_shutter

    _check_scene(scene)
    _refuse_shutter(scene, "a camera array")
    if array is None:
        return photograph(
            scene, samples_per_pixel, instants, device=opened(device), progress=progress
        )
    return trace_shutter(
        scene, array, 1 if instants is None else instants,
        1 if samples_per_pixel is None else samples_per_pixel,
        device=opened(device), progress=progress,
    )  # fmt: skip
