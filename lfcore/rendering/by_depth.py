"""Pictures traced with few rays, sliced by depth."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from lfcore.errors import OpticsError
from lfcore.optics.bundles import texture_width
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SensorPlane
from lfcore.optics.ray_cells import ViewSet, lens_cells, views_of
from lfcore.optics.size import Pixels, Size
from lfcore.optics.slab import Lattice, Slab
from lfcore.progress import Progress, part_of
from lfcore.refocus.depth_slicing import DepthSlicer, planes_at_a_time
from lfcore.refocus.lens_views import lens_margin
from lfcore.refocus.two_parts import Part, TwoPartSlicer
from lfcore.rendering.direct import focused_camera
from lfcore.rendering.exposure import ExposedTracer, ray_times, view_times
from lfcore.tracing.packets import PACKET_ROWS
from lfcore.tracing.tracer import Tracer

RAYS_AT_A_TIME = 1 << 21
"""The rays traced at a time, some views or some rows of a view: their colours and depths, 16 bytes
per ray, fit a cache of 32 MiB."""


def pictures_by_depth(
    tracer: Tracer,
    camera: Camera,
    planes: Sequence[SensorPlane],
    pixels: Pixels,
    lattice: Lattice,
    *,
    progress: Progress | None = None,
) -> np.ndarray:
    """Pictures of a scene from the same rays: (P, height, width, 3) float32, linear light.

    Rays pass the widest aperture of the planes; a single plane is traced at its own focus.
    Raises :class:`OpticsError` for a focus inside the focal length, a plane wider than the lens, or
    pictures too large for the device's memory.
    """
    planes, size = list(planes), Size.of(pixels)
    if margin := lens_margin(planes, camera, size):
        wide = Size(*(side + 2 * margin for side in size))
        camera = replace(camera, sensor_width_m=camera.sensor_width_m * wide.shorter / size.shorter)
        whole = _pictures(tracer, camera, planes, wide, lattice, progress)
        return np.ascontiguousarray(whole[:, margin:-margin, margin:-margin])
    return _pictures(tracer, camera, planes, size, lattice, progress)


def _pictures(
    tracer: Tracer,
    camera: Camera,
    planes: Sequence[SensorPlane],
    size: Size,
    lattice: Lattice,
    progress: Progress | None,
) -> np.ndarray:
    if len(planes) == 1:
        return _focused(tracer, camera, planes[0], size, lattice, progress)[None]
    lens = traced_camera(camera, planes)
    views = views_of(Slab.of(lens, lattice, size), displaced=lattice.displaced)
    # Each group of planes traces the rays again.
    room = planes_at_a_time(tracer.device, planes, size, tracer.needs.stops)
    room = max(1, room // 2) if tracer.needs.specular else room
    groups = [planes[first : first + room] for first in range(0, len(planes), room)]
    parts = []
    for number, group in enumerate(groups):
        tell = part_of(progress, number, len(groups))
        parts.append(trace_by_depth(tracer, views, group, size.longer, progress=tell))
    pictures = np.concatenate(parts)
    for picture, plane in zip(pictures, planes, strict=True):
        if plane.normalise == "lens":  # of the whole lens, not of the traced part
            picture *= (camera.f_number / lens.f_number) ** 2
    return pictures


def traced_camera(camera: Camera, planes: Sequence[SensorPlane]) -> Camera:
    """The lens whose rays form ``planes``: as wide as the widest, and focused at a single plane."""
    if len(planes) == 1:
        return focused_camera(camera, planes[0])
    return replace(camera, f_number=min(plane.f_number for plane in planes))


def _focused(
    tracer: Tracer,
    camera: Camera,
    plane: SensorPlane,
    size: Size,
    lattice: Lattice,
    progress: Progress | None,
) -> np.ndarray:
    slab = Slab.of(traced_camera(camera, [plane]), lattice, size)
    views = views_of(slab, displaced=lattice.displaced)
    stopped = replace(plane, normalise="aperture", keep_magnification=False)
    picture = trace_by_depth(tracer, views, [stopped], size.longer, progress=progress)[0]
    if plane.normalise == "lens":
        # The part of the scene's lens that is open: the aperture's of the square that was traced,
        # times that square's of the lens, whose diameters are as 1 / f-number.
        open_part = lens_cells(views.slab, stopped.lens_aperture(views.slab)).share.mean()
        open_part *= (camera.f_number / plane.f_number) ** 2
        # A sensor at another distance spreads the same light over magnification² as many pixels,
        # by the distances of the scene's own camera: its views and pixels do not matter.
        magnification = plane.magnification(Slab(camera, 1, 1))
        picture *= open_part / magnification**2
    return picture


def trace_by_depth(
    tracer: Tracer,
    views: ViewSet,
    planes: Sequence[SensorPlane],
    pixels: int,
    *,
    progress: Progress | None = None,
) -> np.ndarray:
    """Trace views and slice them by depth: (P, height, width, 3) float32, linear light.

    ``pixels`` is the length of the pictures' longer side.  Raises as :func:`pictures_by_depth`.
    """
    device = tracer.device
    size = Size(*views.slab.picture(pixels)[2:])
    stops = tracer.needs.stops
    needed = DepthSlicer.sums_bytes(planes, size, stops) * (2 if tracer.needs.specular else 1)
    if needed > device.device.global_mem_size // 2:
        problem = f"sums of {len(planes)} pictures of {size} pixels take {needed / 2**30:.1f} GiB"
        remedy = "Ask for fewer pixels or pictures, or use the filter 'nearest'"
        raise OpticsError(problem, key="pixels", remedy=remedy)
    slicer = TwoPartSlicer(views, planes, pixels, device, stops=stops)
    done = 0
    for part, first, parts in traced_views(
        tracer, views, pixels, in_rows=True, whole_views=False, placed=True
    ):
        slicer.add(part, parts, first)
        if first + parts[0][1].shape[1] == views.slab.size.height:
            done += part.stop - part.start
            if progress:
                progress(done, len(views.positions))
    return slicer.pictures()


def traced_views(
    tracer: Tracer,
    views: ViewSet,
    pixels: int,
    footprint_px: float | None = None,
    *,
    order: np.ndarray | None = None,
    in_rows: bool = False,
    whole_views: bool = True,
    placed: bool = False,
) -> Iterator[tuple[slice, int, list[Part]]]:
    """Trace a few views at a time: yield part, first row, and the rays as :meth:`Tracer.parts`.

    ``pixels`` is the longer side of the pictures that textures are filtered for; ``part`` is a
    slice of ``order``, the numbers of the views.  With ``in_rows``, large views are traced some
    rows at a time; ``placed`` is as for :meth:`Tracer.parts`.  Under an open shutter ``placed``
    does not count, and each view is traced at its own instant, or with ``whole_views=False`` at
    four, and views of the same instants follow one another.
    """
    slab = views.slab
    pitch = slab.camera.field_width / pixels
    if footprint_px is None:
        footprint_px = texture_width((slab.views * slab.pixels / pixels) ** 2)
    footprint = min(slab.pixel_pitch, footprint_px * pitch)
    order = np.arange(slab.views**2) if order is None else order
    count, step = len(order), max(1, RAYS_AT_A_TIME // math.prod(slab.size))
    rows = slab.size.height
    if in_rows:  # in whole packets, so that no ray's bits change
        rows = max(1, RAYS_AT_A_TIME // slab.size.width // PACKET_ROWS) * PACKET_ROWS
    starts: Sequence[int] = range(0, count, step)
    if isinstance(tracer, ExposedTracer):
        every = view_times(slab.views)[:, None, None] if whole_views else ray_times(slab.views)
        shares, step = every[order], 1
        starts = range(count) if whole_views else np.argsort(shares.min((1, 2))).tolist()
    for start in starts:
        part = slice(start, min(start + step, count))
        bundles = views.bundles(order[part], footprint=footprint)
        for first in range(0, bundles.rows, rows):
            band = first, min(rows, bundles.rows - first)
            rays = replace(bundles, band=band)
            if isinstance(tracer, ExposedTracer):
                yield part, first, tracer.parts_at(shares[start], rays)
            else:
                yield part, first, tracer.parts(rays, placed=placed)
