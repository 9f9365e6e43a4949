"""Pictures traced with few rays, sliced by depth."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from lfcore.optics.planes import SensorPlane
from lfcore.optics.ray_cells import ViewSet
from lfcore.refocus.depth_slicing import DepthSlicer
from lfcore.tracing.tracer import Tracer

RAYS_AT_A_TIME = 1 << 23
FOOTPRINT_PX = 0.25
"""Most that textures are filtered over, in pixels of the picture: measured,
docs/notebook/true-picture.md."""


def trace_by_depth(
    tracer: Tracer,
    views: ViewSet,
    planes: Sequence[SensorPlane],
    pixels: int,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> np.ndarray:
    """Trace views and slice them by depth: (P, pixels, pixels, 3) float32, linear light.

    ``progress`` is called with (views done, of all).
    Raises :class:`OpticsError` for a plane that the views do not hold.
    """
    slicer = DepthSlicer(views, planes, pixels, tracer.device)
    for part, light, depth in traced_views(tracer, views, pixels):
        slicer.add(part, light, depth)
        if progress:
            progress(part.stop, len(views.positions))
    return slicer.pictures()


def traced_views(
    tracer: Tracer, views: ViewSet, pixels: int
) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
    """Yield (part, light, depth) of a few views at a time, for pictures of so many pixels.

    ``light`` is (K, S, S, 3) and ``depth`` (K, S, S) float32, valid until the next is asked for.
    """
    slab = views.slab
    footprint = min(slab.pixel_pitch, FOOTPRINT_PX * slab.camera.field_width / pixels)
    count, step = slab.views**2, max(1, RAYS_AT_A_TIME // slab.pixels**2)
    for start in range(0, count, step):
        part = slice(start, min(start + step, count))
        bundles = views.bundles(part, footprint=footprint)
        yield part, tracer.bundle_radiance(bundles), tracer.bundle_hits(bundles)[1]
