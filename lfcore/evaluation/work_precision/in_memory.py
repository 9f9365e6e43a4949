"""Pictures from views in memory, by every method of refocusing them."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

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
from lfcore.refocus.resampling import FILTERS
from lfcore.refocus.shift_sum import shift_sum_views
from lfcore.rendering.plenoptic import refocus_photograph
from lfcore.tracing.tracer import Tracer

TOLERANCES_PX = (0.5, 0.1)
ROWS = 16  # of pixels, traced at a time
Planes = Sequence[SensorPlane]


@dataclass(frozen=True)
class Views:
    """A light field in memory: ``light`` (N, N, M, M, 3) float32, linear light, [j, i, v, u]."""

    slab: Slab
    light: np.ndarray
    tracer: Tracer

    @cached_property
    def as_array(self) -> DeviceField:
        """The pictures of an array with a camera at the middle of each view's lens sample."""
        array = CameraArray.from_slab(self.slab)
        return DeviceField(self.tracer.device, array.mosaic(self.light), array)


def memory_rows(
    tracer: Tracer, reference: Reference, views: Sequence[int], monte_carlo_samples: Sequence[int]
) -> Iterator[dict]:
    """Rows of every method by N, and of two by a setting of their own at the largest N.

    Tracing the views is not counted.  Methods make squares, and wide pictures are a part of these.
    """
    planes = reference.planes
    for n in sorted(views):
        slab = Slab.of(tracer.scene.camera, n, reference.size)
        field = trace_views(tracer, replace(slab, extent=None))
        left, top, width, height = slab.held.pixels
        shown = np.s_[:, top : top + height, left : left + width]
        works = [(name, f"N = {n}", method(field, planes)) for name, method in METHODS.items()]
        if n == max(views):
            for each in TOLERANCES_PX:
                work = _by_views(focal_stack_views, field, planes, tolerance_px=each)
                works.append((f"fast stack, N = {n}", f"{each:g} px", work))
            for count in monte_carlo_samples:
                work = _monte_carlo(field, planes, count)
                works.append((f"Monte Carlo, N = {n}", str(count), work))
        for name, setting, work in works:
            yield timed_point(
                reference, partial(_shown, work, shown), tracer.device, panel=IN_MEMORY,
                method=name, setting=setting, rays=field.slab.rays,
            )  # fmt: skip


def trace_views(tracer: Tracer, slab: Slab) -> Views:
    """All views of a slab, each colour clipped as stored ones are."""
    side, n = slab.pixels, slab.views
    light = np.empty((n, n, side, side, 3), np.float32)
    for row in range(0, side, ROWS):
        down = np.arange(row, min(side, row + ROWS))
        places = np.stack(np.meshgrid(np.arange(side), down), -1).reshape(-1, 2)
        some = tracer.bundle_radiance(macropixels(slab, places), places)
        some = some.reshape(len(down), side, n, n, 3).clip(0, 1)
        light[:, :, down] = some.transpose(2, 3, 0, 1, 4)
    return Views(slab, light, tracer)


Work = Callable[[], np.ndarray]


def _shown(work: Work, shown: tuple) -> np.ndarray:
    return work()[shown]


def _by_views(form: Callable, field: Views, planes: Planes, **how: object) -> Work:
    return partial(form, field.slab, field.light, planes, device=field.tracer.device, **how)


def _plenoptic(field: Views, planes: Planes) -> Work:
    slab, side = field.slab, field.slab.views * field.slab.pixels
    photograph = np.ascontiguousarray(field.light.transpose(2, 0, 3, 1, 4)).reshape(side, side, 3)

    def work() -> np.ndarray:
        camera = PlenopticCamera(slab.camera, slab.pixels, slab.views)
        return refocus_photograph(camera, photograph, planes, device=field.tracer.device)

    return work


def _by_array(form: Callable, field: Views, planes: Planes) -> Work:
    """``form`` of the views as an array's picture, a camera at the middle of their lens, and a
    focal plane, for each plane."""
    views, focal_length_m = field.as_array, field.slab.camera.focal_length_m
    array = views.array

    def work() -> np.ndarray:
        made = []
        for plane in planes:
            radius = focal_length_m / (2 * plane.f_number)
            camera = VirtualCamera(np.zeros(3), np.eye(3), array.fov_deg, array.tile, radius)
            made.append(form(views, camera, parallel(plane.focus_m)).image.astype(float))
        return np.stack(made)

    return work


def _isaksen(views: DeviceField, camera: VirtualCamera, surface: FocalSurface) -> Synthesis:
    return isaksen(views, camera, surface, camera.lens_radius_m)


def _monte_carlo(field: Views, planes: Planes, samples: int) -> Work:
    return _by_array(partial(monte_carlo, samples_per_pixel=samples, seed=0), field, planes)


METHODS: dict[str, Callable[[Views, Planes], Work]] = {
    **{f"shift-sum, {name}": partial(_by_views, shift_sum_views, filter=name) for name in FILTERS},
    "plenoptic camera": _plenoptic,
    "Isaksen": partial(_by_array, _isaksen),
}
"""The methods whose setting is N."""
