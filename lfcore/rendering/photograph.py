"""The picture of a scene's own camera: a thin lens, one pinhole, or an array of pinholes.

As in pbrt: the whole film, the file's rays per pixel, and a shutter that is open while objects
move. The shutter's time is cut into equal intervals and the scene is traced once in the middle of
each; the mean is the exposure.  Each camera of an array is one element of bundles, with its pixels
as the inner grid.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lfcore.errors import OpticsError
from lfcore.opencl.device import Device
from lfcore.optics.array import CameraArray
from lfcore.optics.bundles import Bundles, texture_width
from lfcore.progress import Progress
from lfcore.refocus.array import sampling
from lfcore.refocus.array.virtual_camera import VirtualCamera
from lfcore.rendering.prepared import tracers_at
from lfcore.scene.model import Scene
from lfcore.scene.view import LIGHTFIELD
from lfcore.tracing.tracer import Tracer

MOST_INSTANTS = 16
"""The most instants of an open shutter, unless more are given."""
_CHUNK_RAYS = 1 << 23
"""The rays traced at a time, of several lens points: their pictures take 96 MiB."""


def photograph(
    scene: Scene,
    samples_per_pixel: int | None = None,
    instants: int | None = None,
    *,
    device: Device | None = None,
    progress: Progress | None = None,
) -> np.ndarray:
    """The picture of ``scene.view``: (height, width, 3) float32, linear radiance.

    ``samples_per_pixel`` is by default the view's.  ``instants`` of the shutter is by default 1 if
    nothing moves, else up to 16; rays are rounded up to a multiple of the instants.
    """
    view = scene.view
    if view is None:
        raise OpticsError(
            "the scene has no camera array or film of its own", key="view",
            remedy="Give an array, for example CameraArray.on_grid",
        )  # fmt: skip
    samples = view.samples_per_pixel if samples_per_pixel is None else samples_per_pixel
    if samples < 1:
        raise OpticsError(f"must be at least 1, not {samples}", key="samples_per_pixel")
    moves = scene.instants and view.shutter[1] > view.shutter[0]
    instants = instants or (min(samples, MOST_INSTANTS) if moves else 1)
    samples_each = -(-samples // instants)

    def picture(tracer: Tracer, index: int) -> np.ndarray:
        if view.kind == LIGHTFIELD or not view.lens_radius_m:
            return trace_array(tracer, view.array, samples_each, seed=index)
        camera = VirtualCamera(
            np.zeros(3), np.eye(3), view.array.fov_deg, view.film, view.lens_radius_m
        )
        # Every instant has other lens points.
        return direct_thin_lens(
            tracer, camera, view.camera.focus_m, samples_each, first=index * samples_each
        )

    return expose(scene, instants, picture, device=device, progress=progress)


def direct_thin_lens(
    tracer: Tracer, camera: VirtualCamera, focus_z: float, samples_per_pixel: int, *, first: int = 0
) -> np.ndarray:
    """The scene itself through a thin lens: (h, w, 3) float32 linear radiance.

    All pixels share one Halton set over film and lens, so there is no noise from pixel to pixel.
    ``first`` skips that many points of the set.  Each point is a pinhole on the lens, sheared so
    that the pictures coincide on the plane z = focus_z.  Rays start in the plane z = 0, the origin
    of bundles: surfaces behind that plane are not hit, and surfaces between it and a camera at
    z > 0 occlude the scene.
    """
    if samples_per_pixel < 1:
        raise OpticsError(f"must be at least 1, not {samples_per_pixel}", key="samples_per_pixel")
    if not np.allclose(camera.rotation, np.eye(3), atol=1e-12):
        raise OpticsError("a directly traced thin lens must look along z", key="rotation")
    x, y, z = camera.position_m
    distance = focus_z - z
    if not distance > 0:
        raise OpticsError(f"the focus is {-distance:g} m behind the camera", key="focus_z")
    # Shifted by half a cell: the set's first point is the corner (0, 0, 0, 0).
    points = sampling.halton_table(first + samples_per_pixel)[first:]
    samples = (points + 0.5 / (first + samples_per_pixel)) % 1.0
    lens = np.stack(sampling.concentric_disk(samples[:, 2], samples[:, 3]), -1)
    lens = lens * camera.lens_radius_m
    pitch = camera.pixel_pitch
    tangents = (samples[:, :2] - 0.5) * pitch - lens / distance
    origins = np.array([x, y]) + lens - z * tangents
    elements = np.concatenate([origins, tangents], 1).astype(np.float32)
    step = np.array([-z * pitch, -z * pitch, pitch, pitch], np.float32)
    footprint = pitch * texture_width(samples_per_pixel)
    bundles = Bundles(elements, step, *camera.size, footprint)
    total = np.zeros((*camera.size[::-1], 3), np.float64)
    chunk = max(1, min(32, _CHUNK_RAYS // (camera.size[0] * camera.size[1])))
    for start in range(0, samples_per_pixel, chunk):
        part = replace(bundles, elements=bundles.elements[start : start + chunk])
        total += tracer.bundle_radiance(part).sum(0, dtype=np.float64)
    return (total / samples_per_pixel).astype(np.float32)


def shutter_times(count: int) -> np.ndarray:
    """(count,) instants in [0, 1], the middles of intervals."""
    if count < 1:
        raise OpticsError(f"must be at least 1, not {count}", key="times")
    return (np.arange(count) + 0.5) / count


def expose(
    scene: Scene,
    times: int,
    picture: Callable[[Tracer, int], np.ndarray],
    *,
    device: Device | None = None,
    progress: Progress | None = None,
) -> np.ndarray:
    """The mean over the open shutter of ``picture(tracer, instant's number)``, float32.

    Every instant has its own hierarchy if something moves.  Light is baked once, for the first
    poses.
    """
    opened_s, closed_s = (scene.view.shutter if scene.view else scene.instants) or (0.0, 0.0)
    if closed_s == opened_s:
        scene = scene.at(opened_s)
    instants = opened_s + shutter_times(times) * (closed_s - opened_s)
    total: np.ndarray = np.zeros(())
    for index, tracer in enumerate(tracers_at(scene, instants.tolist(), device)):
        total = total + picture(tracer, index).astype(np.float64)
        if progress is not None:
            progress(index + 1, len(instants))
    return (total / len(instants)).astype(np.float32)


def trace_shutter(
    scene: Scene,
    array: CameraArray,
    times: int,
    samples_per_pixel: int = 1,
    *,
    device: Device | None = None,
    progress: Progress | None = None,
) -> np.ndarray:
    """The mean of ``times`` traces of the moving scene: (Ny h, Nx w, 3) float32, linear; a scene at
    rest is traced once."""

    def picture(tracer: Tracer, index: int) -> np.ndarray:
        return trace_array(tracer, array, samples_per_pixel, seed=index)

    times = times if scene.instants else 1
    return expose(scene, times, picture, device=device, progress=progress)


def array_bundles(array: CameraArray, offsets: np.ndarray, samples: int) -> Bundles:
    """All data cameras, row after row, as bundles.

    ``offsets`` (Ny Nx, 2) moves each camera's rays within their pixels, in pixels from the centre.
    ``samples`` per pixel narrow the footprint of texture filtering.
    """
    origins = array.origins().reshape(-1, 3)[:, :2]
    tangents = -array.delta * origins + offsets * array.pixel_pitch
    elements = np.concatenate([origins, tangents], 1).astype(np.float32)
    pitch = array.pixel_pitch
    step = np.array([0.0, 0.0, pitch, pitch], np.float32)
    return Bundles(elements, step, *array.tile, pitch / math.sqrt(samples))


def stratified_offsets(cameras: int, samples: int, seed: int) -> np.ndarray:
    """(samples, cameras, 2) in pixels from the centre: one in each stratum, jittered per camera.

    One sample per pixel is its centre, without jitter.
    """
    if samples == 1:
        return np.zeros((1, cameras, 2))
    columns, rows = sampling.strata(samples)
    cell = np.arange(samples)
    corner = np.stack([cell % columns, cell // columns], -1)[:, None]
    jitter = np.random.default_rng(seed).random((samples, cameras, 2))
    return (corner + jitter) / [columns, rows] - 0.5


def trace_array(
    tracer: Tracer, array: CameraArray, samples_per_pixel: int = 1, *, seed: int = 0
) -> np.ndarray:
    """(Ny h, Nx w, 3) float32 linear radiance of all data cameras, not clamped, tiles as
    :class:`CameraArray` lays them out.

    Each camera has its own jitter of ``samples_per_pixel``; its pixels share it, so that their rays
    are one bundle.
    """
    if samples_per_pixel < 1:
        raise OpticsError(f"must be at least 1, not {samples_per_pixel}", key="samples_per_pixel")
    nx, ny = array.cameras
    offsets = stratified_offsets(nx * ny, samples_per_pixel, seed)
    sets = [array_bundles(array, offset, samples_per_pixel) for offset in offsets]
    image = tracer.mosaic_radiance(sets, nx)
    if samples_per_pixel > 1:
        image /= samples_per_pixel
    return image
