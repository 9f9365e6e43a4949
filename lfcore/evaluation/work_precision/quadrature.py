"""The average over lens and pixel by few rays: grids, and strata, Halton and independent points."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from lfcore.evaluation.true_picture.reference import check_unlike
from lfcore.evaluation.work_precision import samples, windows
from lfcore.evaluation.work_precision.convergence import with_orders
from lfcore.evaluation.work_precision.measured_point import measured_point, rmse
from lfcore.evaluation.work_precision.windows import Windows
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.rendering.by_depth import RayCount
from lfcore.rendering.direct import focused_camera, tile_sums
from lfcore.storage.layout import FrameLayout
from lfcore.tracing.tracer import Tracer

if TYPE_CHECKING:
    from lfcore.evaluation.work_precision.curves import Study

SEEDS, SEEDED_SECONDS = 3, 0.1
LONGEST_SECONDS = 1.0
"""A curve of samples ends before pictures that take longer, four times those before them."""
MIDDLE = "middle of the pixel"
"""The thesis's recipe: a grid of the lens, and all of its rays through one place of a pixel."""


def quadrature(tracer: Tracer, study: Study, stops: float) -> Iterator[dict]:
    """Windows of the picture in focus, whose rays no refocusing moves, against the true picture.

    That is the mean of two unlike lattices of lens and pixel, each ray in its own pixel; what they
    disagree by is its error, as of :func:`lfcore.evaluation.true_picture.reference.true_pictures`.
    """
    own = tracer.scene.camera
    plane = SensorPlane(own.focus_distance_m, own.f_number * 2 ** (stops / 2))
    camera = focused_camera(own, plane)
    where = windows.choose(tracer, camera, study.window_picture)
    truth, doubt_of = true_windows(tracer, camera, where, study.window_truth)
    doubts = {
        f"reference_{name}": doubt_of(mask) for name, mask in where.parts.items() if mask.any()
    }
    context: dict[str, Any] = {"panel": "quadrature", "f_number": plane.f_number, **doubts}
    whole = doubt_of(np.ones(truth.shape[:2], bool))

    def row(
        method: str, views: int, work: Callable[[int], np.ndarray], rays: int, seeds: int = 1
    ) -> dict:
        return measured_point(
            work, truth, whole, seeds=seeds, parts=where.parts, method=method, knob=f"N = {views}",
            rays_per_pixel=int(rays), **context,
        )  # fmt: skip

    yield from with_orders(
        row(MIDDLE, views, _grid_work(tracer, camera, where, views), _mask(camera, views).sum())
        for views in study.views
    )
    for pattern in samples.PATTERNS:
        curve, before = [], 0.0
        for views in study.views:
            if 4 * before > LONGEST_SECONDS:
                break
            several = pattern in samples.RANDOM and 4 * before <= SEEDED_SECONDS
            work = _sampled_work(tracer, camera, where, pattern, views)
            rays = len(samples.samples(pattern, views, 0).weight)
            curve.append(row(pattern, views, work, rays, SEEDS if several else 1))
            before = curve[-1]["seconds"] or 0.0
        yield from with_orders(curve)


def true_windows(
    tracer: Tracer, camera: Camera, where: Windows, counts: Sequence[Sequence[int]]
) -> tuple[np.ndarray, Callable[[np.ndarray], float]]:
    """(W 16, 16, 3) float64 linear light, and the error of the pixels of a mask.

    ``counts`` are two lattices, lens samples and rays of a pixel a side.
    """
    lattices = [RayCount(int(views), subpixels) for views, subpixels in counts]
    check_unlike(lattices)
    one, two = (
        samples.pictures(
            tracer, camera, where.pixels, samples.crossed(count.views), where.corners,
            windows.SIDE, subpixels=int(count.subpixels),
        )
        for count in lattices
    )  # fmt: skip
    truth = np.average([one, two], axis=0, weights=[count.rays_a_pixel for count in lattices])
    return truth, lambda mask: rmse([one[mask]], two[mask]) / np.sqrt(2)


def _mask(camera: Camera, views: int) -> np.ndarray:
    return SensorPlane(camera.focus_distance_m, camera.f_number).mask(Slab(camera, views, 1))


def _grid_work(
    tracer: Tracer, camera: Camera, where: Windows, views: int
) -> Callable[[int], np.ndarray]:
    return lambda _: grid(tracer, camera, where, views)


def _sampled_work(
    tracer: Tracer, camera: Camera, where: Windows, pattern: str, views: int
) -> Callable[[int], np.ndarray]:
    def work(seed: int) -> np.ndarray:
        points = samples.samples(pattern, views, seed)
        return samples.pictures(tracer, camera, where.pixels, points, where.corners, windows.SIDE)

    return work


def grid(tracer: Tracer, camera: Camera, where: Windows, views: int) -> np.ndarray:
    """(W 16, 16, 3) float64 linear light: the mean over a grid of ``views`` a side."""
    slab = Slab(camera, views, where.pixels)
    plane = SensorPlane(camera.focus_distance_m, camera.f_number)
    layout = FrameLayout("macropixels", views, where.pixels)
    rays = int(plane.mask(slab).sum()) * 2.0**20
    found = []
    for column, row in where.corners.tolist():
        tile = layout.tile(column, row, windows.SIDE, windows.SIDE)
        sums = tile_sums(tracer, slab, tile, [plane])
        top, left = row - sums.top, column - sums.left
        part = sums.sums[0, :, top : top + windows.SIDE, left : left + windows.SIDE]
        found.append(part.transpose(1, 2, 0) / rays)
    return np.concatenate(found)
