"""Pictures from views in memory, by every method of refocusing them."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from lfcore.evaluation.true_picture import Reference
from lfcore.evaluation.work_precision.points import IN_MEMORY, timed_point
from lfcore.optics.array import CameraArray
from lfcore.optics.bundles import macropixels
from lfcore.optics.planes import SensorPlane
from lfcore.optics.plenoptic import PlenopticCamera
from lfcore.optics.slab import Slab
from lfcore.refocus.array.device_field import DeviceField, Synthesis
from lfcore.refocus.array.focal_surface import FocalSurface, parallel
from lfcore.refocus.array.synthesis import isaksen, monte_carlo
from lfcore.refocus.array.virtual_camera import VirtualCamera
from lfcore.refocus.focal_stack import focal_stack_views
from lfcore.refocus.resampling import FILTERS, crop
from lfcore.refocus.shift_sum import shift_sum_views
from lfcore.rendering.plenoptic import refocus_photograph
from lfcore.tracing.tracer import Tracer

TOLERANCES_PX = (0.5, 0.1)
ROWS = 16
"""The rows of pixels traced at a time."""
Planes = Sequence[SensorPlane]


class Views:
    """A light field of a square slab in memory, in the forms that methods need.

    ``light`` is that of :func:`trace_views`; ``field`` has a camera at the middle of each view's
    lens sample; ``photograph`` is a plenoptic camera's.
    """

    def __init__(self, tracer: Tracer, slab: Slab):
        self.slab, self.device, self.light = slab, tracer.device, trace_views(tracer, slab)
        array, side = CameraArray.from_slab(slab), slab.views * slab.pixels
        self.field = DeviceField(self.device, array.mosaic(self.light), array)
        self.photograph = self.light.transpose(2, 0, 3, 1, 4).reshape(side, side, 3)


def memory_rows(
    tracer: Tracer, reference: Reference, views: Sequence[int], monte_carlo_samples: Sequence[int]
) -> Iterator[dict]:
    """Rows of every method by N, and of two methods by their setting at the largest N.

    Seconds exclude tracing.  Methods make square pictures; wide ones are cut out.
    """
    for n in sorted(views):
        slab = Slab.of(tracer.scene.camera, n, reference.size)
        in_memory = Views(tracer, replace(slab, extent=None))
        works = [(name, f"N = {n}", method) for name, method in METHODS.items()]
        if n == max(views):
            for tolerance in TOLERANCES_PX:
                stack = partial(_by_views, focal_stack_views, tolerance_px=tolerance)
                works.append((f"fast stack, N = {n}", f"{tolerance:g} px", stack))
            for count in monte_carlo_samples:
                works.append((f"Monte Carlo, N = {n}", str(count), _monte_carlo(count)))
        for name, setting, method in works:
            yield timed_point(
                reference, partial(_cropped, slab, method, in_memory, reference.planes),
                in_memory.device,
                panel=IN_MEMORY, method=name, setting=setting, rays=in_memory.slab.rays,
            )  # fmt: skip


def trace_views(tracer: Tracer, slab: Slab) -> np.ndarray:
    """All views of a square slab, (N, N, M, M, 3) float32, linear light, [j, i, v, u]; colours
    are clipped as in files."""
    side, n = slab.pixels, slab.views
    light = np.empty((n, n, side, side, 3), np.float32)
    for row in range(0, side, ROWS):
        down = np.arange(row, min(side, row + ROWS))
        places = np.stack(np.meshgrid(np.arange(side), down), -1).reshape(-1, 2)
        some = tracer.bundle_radiance(macropixels(slab, places), places)
        some = some.reshape(len(down), side, n, n, 3).clip(0, 1)
        light[:, :, down] = some.transpose(2, 3, 0, 1, 4)
    return light


Method = Callable[[Views, Planes], np.ndarray]


def _cropped(slab: Slab, method: Method, views: Views, planes: Planes) -> np.ndarray:
    return crop(slab, method(views, planes))


def _by_views(form: Callable, views: Views, planes: Planes, **options: Any) -> np.ndarray:
    return form(views.slab, views.light, planes, device=views.device, **options)


def _plenoptic(views: Views, planes: Planes) -> np.ndarray:
    camera = PlenopticCamera(views.slab.camera, views.slab.pixels, views.slab.views)
    return refocus_photograph(camera, views.photograph, planes, device=views.device)


def _by_array(form: Callable, views: Views, planes: Planes) -> np.ndarray:
    """Apply ``form`` to the field, a camera at the lens's middle and each focal plane."""
    array, pictures = views.field.array, []
    for plane in planes:
        radius = views.slab.camera.focal_length_m / (2 * plane.f_number)
        camera = VirtualCamera(np.zeros(3), np.eye(3), array.fov_deg, array.tile, radius)
        pictures.append(form(views.field, camera, parallel(plane.focus_m)).image.astype(float))
    return np.stack(pictures)


def _isaksen(field: DeviceField, camera: VirtualCamera, surface: FocalSurface) -> Synthesis:
    return isaksen(field, camera, surface, camera.lens_radius_m)


def _monte_carlo(samples: int) -> Method:
    return partial(_by_array, partial(monte_carlo, samples_per_pixel=samples, seed=0))


METHODS: dict[str, Method] = {
    **{f"shift-sum, {name}": partial(_by_views, shift_sum_views, filter=name) for name in FILTERS},
    "plenoptic camera": _plenoptic,
    "Isaksen": partial(_by_array, _isaksen),
}
"""The methods whose setting is N."""
