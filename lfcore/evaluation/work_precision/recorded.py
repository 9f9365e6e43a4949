"""One refocused picture of a recorded light field, by every method."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from lfcore.evaluation.true_picture.reference import Reference
from lfcore.evaluation.work_precision.refocused import refocused_row
from lfcore.evaluation.work_precision.study import Study
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

STACK = 16  # pictures of a focal stack, whose seconds one of them has its share of
TOLERANCES_PX = (0.5, 0.2, 0.1, 0.05)
MOST_VIEWS = 32  # of light fields that are kept in memory
Work = Callable[[int], np.ndarray]  # of a seed


@dataclass(frozen=True)
class Recorded:
    """A light field in memory: ``views`` (N, N, M, M, 3) float32, linear light, [j, i, v, u]."""

    slab: Slab
    views: np.ndarray


def recorded_methods(tracer: Tracer, study: Study, truth: Reference) -> Iterator[dict]:
    """The picture of ``truth`` from views in memory; recording them is not counted."""
    camera, plane = tracer.scene.camera, truth.planes[0]
    row = partial(refocused_row, truth, "recorded")
    fields = [
        record(tracer, Slab(camera, views, study.pixels))
        for views in study.views
        if views <= MOST_VIEWS
    ]
    for name, method in METHODS.items():
        for field in fields:
            work = method(tracer, field, plane)
            yield row(name, f"N = {field.slab.views}", field.slab, work)
    for field in fields[-1:]:
        slab = field.slab
        name = f"Monte Carlo, N = {slab.views}"
        for samples in study.monte_carlo_samples:
            work = _monte_carlo(tracer, field, plane, samples)
            yield row(name, f"{samples} samples", slab, work)
        name = f"fast stack, N = {slab.views}"
        for tolerance in TOLERANCES_PX:
            work = _stack(tracer, field, plane, tolerance)
            yield row(name, f"{tolerance:g} px", slab, work, pictures=STACK)


def record(tracer: Tracer, slab: Slab) -> Recorded:
    """All views of a slab, each colour clipped as stored ones are."""
    side, views = slab.pixels, slab.views
    places = np.stack(np.meshgrid(np.arange(side), np.arange(side)), -1).reshape(-1, 2)
    light = np.clip(tracer.bundle_radiance(macropixels(slab, places), places), 0, 1)
    light = light.reshape(side, side, views, views, 3).transpose(2, 3, 0, 1, 4)
    return Recorded(slab, np.ascontiguousarray(light, np.float32))


def _shift_sum(tracer: Tracer, recorded: Recorded, plane: SensorPlane, *, filter: str) -> Work:
    return lambda _: shift_sum_views(
        recorded.slab, recorded.views, [plane], filter=filter, device=tracer.device
    )[0]


def _stack(tracer: Tracer, recorded: Recorded, plane: SensorPlane, tolerance_px: float) -> Work:
    """A stack from the plane to the camera's own focus, of which the plane is the first."""
    deltas = np.linspace(plane.delta, recorded.slab.camera.delta, STACK)
    stack = [SensorPlane(1 / delta, plane.f_number) for delta in deltas]
    return lambda _: focal_stack_views(
        recorded.slab, recorded.views, stack, tolerance_px=tolerance_px, device=tracer.device
    )[0]


def _plenoptic(tracer: Tracer, recorded: Recorded, plane: SensorPlane) -> Work:
    slab = recorded.slab
    side = slab.views * slab.pixels
    photograph = recorded.views.transpose(2, 0, 3, 1, 4).reshape(side, side, 3)
    photograph = np.ascontiguousarray(photograph)

    def work(_: int) -> np.ndarray:
        camera = PlenopticCamera(slab.camera, slab.pixels, slab.views)
        return refocus_photograph(camera, photograph, [plane], device=tracer.device)[0]

    return work


def _field(
    tracer: Tracer, recorded: Recorded, plane: SensorPlane
) -> tuple[DeviceField, VirtualCamera, PlaneSurface]:
    """The views as a camera array's picture, a camera at the middle of its lens, a focal plane."""
    slab, views = recorded.slab, recorded.views
    side = slab.views * slab.pixels
    fov = 2 * math.degrees(math.atan(slab.pixel_pitch * slab.pixels / 2))
    size, half = (slab.pixels, slab.pixels), slab.lens_pitch_m / 2
    lens = tuple(slab.lens_positions().tolist())
    array = CameraArray(lens, lens, fov, size, margin_m=(half, half), delta=slab.camera.delta)
    image = np.ascontiguousarray(views.transpose(0, 2, 1, 3, 4)).reshape(side, side, 3)
    radius = slab.camera.focal_length_m / (2 * plane.f_number)
    camera = VirtualCamera(np.zeros(3), np.eye(3), fov, size, radius)
    surface = PlaneSurface(np.array([0, 0, plane.focus_m]), np.array([0, 0, 1.0]))
    return DeviceField(tracer.device, image, array), camera, surface


def _isaksen(tracer: Tracer, recorded: Recorded, plane: SensorPlane) -> Work:
    field, camera, surface = _field(tracer, recorded, plane)
    return lambda _: isaksen(field, camera, surface, camera.lens_radius_m).image.astype(float)


def _monte_carlo(tracer: Tracer, recorded: Recorded, plane: SensorPlane, samples: int) -> Work:
    field, camera, surface = _field(tracer, recorded, plane)
    return lambda seed: monte_carlo(field, camera, surface, samples, seed=seed).image.astype(float)


METHODS: dict[str, Callable[[Tracer, Recorded, SensorPlane], Work]] = {
    **{f"shift-sum, {name}": partial(_shift_sum, filter=name) for name in FILTERS},
    "plenoptic camera": _plenoptic,
    "Isaksen": _isaksen,
}
"""By name, those whose knob is N."""
