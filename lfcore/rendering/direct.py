"""Pictures traced directly from a scene, without storing the light field (thesis section 6.3.2)."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lfcore.optics.camera import Camera, check_focus, image_distance
from lfcore.optics.plane_sums import total
from lfcore.optics.planes import SensorPlane
from lfcore.optics.size import Pixels
from lfcore.optics.slab import Lattice, Slab
from lfcore.progress import Progress
from lfcore.rendering.tiles import trace_tile
from lfcore.storage.layout import FrameLayout
from lfcore.tracing.tracer import Tracer

PLANES_RAYS = 1 << 26
"""The rays of a tile, whose parts of planes are in memory."""


def trace_planes(
    tracer: Tracer, slab: Slab, planes: Sequence[SensorPlane], *, progress: Progress | None = None
) -> np.ndarray:
    """(P, height, width, 3) float32, linear light: ``planes`` formed while a slab is traced
    (Algorithm 1).  ``progress`` counts pixels."""
    layout = FrameLayout(
        "macropixels", slab.views, slab.pixels, pixel_format="yuv444p", picture=slab.size
    )
    traced, parts, pixels = 0, [], math.prod(slab.size)
    for tile in layout.tiles(PLANES_RAYS, least=1):
        count = (lambda n, _, before=traced: progress(before + n, pixels)) if progress else None
        tracing = trace_tile(tracer, slab, tile, planes, frames=False, progress=count).finished()
        assert tracing.plane_sums is not None  # the tracing has ended
        parts.append(tracing.plane_sums)
        traced += tile.element_count
    return total(slab, list(planes), parts).pictures()


def focused_camera(camera: Camera, plane: SensorPlane) -> Camera:
    """A camera with the focus and aperture of ``plane``.

    Its picture has the plane's extent: without magnification the sensor is scaled with its
    distance, so that tangents stay; with magnification the sensor stays.  No ray moves between
    pixels, so this is the reference for refocused pictures.
    """
    check_focus(plane.focus_m, camera.focal_length_m, key="focus_m")
    scale = 1.0
    if not plane.keep_magnification:
        moved = image_distance(camera.focal_length_m, plane.focus_m)
        scale = moved / camera.image_distance_m
    return replace(
        camera,
        sensor_width_m=camera.sensor_width_m * scale,
        f_number=plane.f_number,
        focus_m=plane.focus_m,
    )


def trace_picture(
    tracer: Tracer,
    camera: Camera,
    pixels: Pixels,
    plane: SensorPlane,
    *,
    views: int | Lattice = 64,
    progress: Progress | None = None,
) -> np.ndarray:
    """One picture traced at its own focus, (height, width, 3) float32, linear light.

    ``views`` is the side of the grid of rays over the square around the aperture: 64 are 4096 rays
    per pixel.  With a lattice, ``plane`` has the picture's pixels.
    """
    slab = Slab.of(focused_camera(camera, plane), views, pixels)
    stopped = replace(plane, normalise="aperture", keep_magnification=False)
    picture = trace_planes(tracer, slab, [stopped], progress=progress)[0]
    if plane.normalise == "lens":
        # This aperture passes a share of the whole lens's N^2 rays, spread by v' / v.
        open_share = stopped.mask(slab).mean() * (camera.f_number / plane.f_number) ** 2
        picture *= open_share / plane.magnification(Slab(camera, 1, 1)) ** 2
    return picture
