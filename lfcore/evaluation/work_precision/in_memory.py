"""Pictures from views in memory, by every method of refocusing them."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from lfcore.evaluation.true_picture import Reference
from lfcore.evaluation.work_precision.points import IN_MEMORY, timed_point
from lfcore.optics.array import CameraArray
from lfcore.optics.bundles import macropixels
from lfcore.optics.planes import SensorPlane
from lfcore.optics.plenoptic import PlenopticCamera
from lfcore.optics.slab import Slab
from lfcore.refocus.array.device_field import DeviceField
from lfcore.refocus.array.focal_surface import PlaneSurface
from lfcore.refocus.array.isaksen import isaksen
from lfcore.refocus.array.monte_carlo import monte_carlo
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


def memory_rows(
    tracer: Tracer, reference: Reference, views: Sequence[int], monte_carlo_samples: Sequence[int]
) -> Iterator[dict]:
    """Rows of every method by N, and of two by a setting of their own at the largest N.

    Tracing the views is not counted.  Methods make squares, and wide pictures are a part of these.
    """
    planes, samples = reference.planes, monte_carlo_samples
    for n in sorted(views):
        slab = Slab.of(tracer.scene.camera, n, reference.size)
        field = trace_views(tracer, replace(slab, extent=None))
        left, top, width, height = slab.held.pixels
        shown = np.s_[:, top : top + height, left : left + width]
        works = {name: (f"N = {n}", method(field, planes)) for name, method in METHODS.items()}
        if n == max(views):
            works |= {
                f"fast stack, N = {n}: {each:g} px": (f"{each:g} px", _stack(field, planes, each))
                for each in TOLERANCES_PX
            }
            works |= {
                f"Monte Carlo, N = {n}: {each}": (f"{each}", _monte_carlo(field, planes, each))
                for each in samples
            }
        for name, (setting, work) in works.items():
            yield timed_point(
                reference, partial(_shown, work, shown), tracer.device,
                panel=IN_MEMORY, method=name.split(":")[0],
                setting=setting, rays=field.slab.rays,
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


def _shift_sum(field: Views, planes: Planes, *, filter: str) -> Work:
    return lambda: shift_sum_views(
        field.slab, field.light, planes, filter=filter, device=field.tracer.device
    )


def _stack(field: Views, planes: Planes, tolerance_px: float) -> Work:
    return lambda: focal_stack_views(
        field.slab, field.light, planes, tolerance_px=tolerance_px, device=field.tracer.device
    )


def _plenoptic(field: Views, planes: Planes) -> Work:
    slab, side = field.slab, field.slab.views * field.slab.pixels
    photograph = np.ascontiguousarray(field.light.transpose(2, 0, 3, 1, 4)).reshape(side, side, 3)

    def work() -> np.ndarray:
        camera = PlenopticCamera(slab.camera, slab.pixels, slab.views)
        return refocus_photograph(camera, photograph, planes, device=field.tracer.device)

    return work


class _Array:
    """The views as a camera array's picture, seen by a camera at the middle of their lens."""

    def __init__(self, field: Views, planes: Planes):
        slab, light = field.slab, field.light
        side = slab.views * slab.pixels
        self.fov = 2 * math.degrees(math.atan(slab.pixel_pitch * slab.pixels / 2))
        self.size, half = (slab.pixels, slab.pixels), slab.lens_pitch_m / 2
        self.focal_length_m, self.planes = slab.camera.focal_length_m, planes
        lens = tuple(slab.lens_positions().tolist())
        array = CameraArray(
            lens, lens, self.fov, self.size, margin_m=(half, half), delta=slab.camera.delta
        )
        image = np.ascontiguousarray(light.transpose(0, 2, 1, 3, 4)).reshape(side, side, 3)
        self.field = DeviceField(field.tracer.device, image, array)

    def pictures(self, form: Callable) -> np.ndarray:
        """``form`` of the array, a camera and a focal plane, for each plane."""
        made = []
        for plane in self.planes:
            radius = self.focal_length_m / (2 * plane.f_number)
            camera = VirtualCamera(np.zeros(3), np.eye(3), self.fov, self.size, radius)
            distance = np.array([0, 0, plane.focus_m])
            surface = PlaneSurface(distance, np.array([0, 0, 1.0]))
            made.append(form(self.field, camera, surface).image.astype(float))
        return np.stack(made)


def _isaksen(field: Views, planes: Planes) -> Work:
    array = _Array(field, planes)
    cone = lambda views, camera, surface: isaksen(views, camera, surface, camera.lens_radius_m)  # noqa: E731
    return lambda: array.pictures(cone)


def _monte_carlo(field: Views, planes: Planes, samples: int) -> Work:
    array = _Array(field, planes)
    return lambda: array.pictures(partial(monte_carlo, samples_per_pixel=samples, seed=0))


METHODS: dict[str, Callable[[Views, Planes], Work]] = {
    **{f"shift-sum, {name}": partial(_shift_sum, filter=name) for name in FILTERS},
    "plenoptic camera": _plenoptic,
    "Isaksen": _isaksen,
}
"""The methods whose setting is N."""
