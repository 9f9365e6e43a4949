"""The integral over the lens by a grid, and by stratified, Halton and independent samples."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from lfcore.evaluation.work_precision import lens_samples, windows
from lfcore.evaluation.work_precision.point import point, rmse, trusted, with_orders
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.rendering.direct import focused_camera, tile_sums
from lfcore.storage.layout import FrameLayout
from lfcore.tracing.tracer import Tracer

SEEDS, SEEDED_SECONDS = 3, 0.1
LONGEST_SECONDS = 2.0
"""A curve of samples ends before pictures that take longer, four times those before them."""
SMOOTH_ORDER = {"grid": 1.5, "stratified": 2.0, "Halton": 2.0, "independent": 1.0}
"""Order in N of a smooth integrand: independent samples err by the square root of their number;
strata and low discrepancy by a power more; a grid is cut off by the rim of the round aperture."""
BROKEN = 0.3
"""How far below that an order lies that is called broken."""


def quadrature(tracer: Tracer, study, stops: float) -> Iterator[dict]:
    """Windows of the picture in focus, whose rays no refocusing moves: errors are of the lens
    integral alone.  The reference is the mean of two grids; half their distance is its error."""
    own = tracer.scene.camera
    plane = SensorPlane(own.focus_distance_m, own.f_number * 2 ** (stops / 2))
    camera = focused_camera(own, plane)
    where = windows.choose(tracer, camera, study.window_picture)
    one, two = (grid(tracer, camera, where, views) for views in study.reference_views)
    reference, doubt = (one + two) / 2, rmse([one], two) / 2
    parts = where.parts
    doubts = {
        f"reference_{name}": rmse([one[mask]], two[mask]) / 2
        for name, mask in parts.items()
        if mask.any()
    }
    context = {"panel": "quadrature", "f_number": plane.f_number, **doubts}

    def row(method: str, views: int, work, rays: int, seeds: int) -> dict:
        more = {"method": method, "knob": f"N = {views}", "rays_per_pixel": int(rays)}
        more["warm"] = method != "grid"  # a grid's program depends on N
        return point(work, reference, doubt, seeds=seeds, parts=parts, **context, **more)

    for pattern in ("grid", *lens_samples.PATTERNS):
        curve, before = [], 0.0
        for views in study.views:
            if pattern != "grid" and 4 * before > LONGEST_SECONDS:
                break
            if pattern == "grid":
                rays = _mask(camera, views).sum()
                curve.append(row(pattern, views, _grid_work(tracer, camera, where, views), rays, 1))
            else:
                seeds = SEEDS if 4 * before <= SEEDED_SECONDS else 1
                work = _sampled_work(tracer, camera, where, pattern, views)
                curve.append(row(pattern, views, work, views**2, seeds))
            before = curve[-1]["seconds"] or 0.0
        yield from with_orders(trusted(curve))


def _mask(camera: Camera, views: int) -> np.ndarray:
    return SensorPlane(camera.focus_distance_m, camera.f_number).mask(Slab(camera, views, 1))


def _grid_work(tracer, camera, where, views) -> Callable[[int], np.ndarray]:
    return lambda _: grid(tracer, camera, where, views)


def _sampled_work(tracer, camera, where, pattern, views) -> Callable[[int], np.ndarray]:
    def work(seed: int) -> np.ndarray:
        points = lens_samples.lens_points(pattern, views, seed)
        corners = where.corners
        return lens_samples.pictures(tracer, camera, where.pixels, points, corners, windows.SIDE)

    return work


def grid(tracer: Tracer, camera: Camera, where: windows.Windows, views: int) -> np.ndarray:
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


def convergence(rows: Sequence[dict]) -> list[dict]:
    """Observed orders by scene, aperture, method and kind of pixel, and whether they break."""
    made = []
    keys = dict.fromkeys((row["scene"], row["f_number"], row["method"]) for row in rows)
    for scene, f_number, method in keys:
        curve = [
            row
            for row in rows
            if (row["scene"], row["f_number"], row["method"]) == (scene, f_number, method)
        ]
        for kind in ("all", *windows.KINDS):
            order, count, last = _order(curve, kind)
            if count < 2:
                continue
            smooth = SMOOTH_ORDER[method]
            made.append(
                {
                    "scene": scene,
                    "f_number": f_number,
                    "method": method,
                    "pixels": kind,
                    "points": count,
                    "rmse_at_last": last,
                    "order": order,
                    "order_if_smooth": smooth,
                    "breaks": order < smooth - BROKEN,
                }
            )
    return made


def _order(curve: Sequence[dict], kind: str) -> tuple[float, int, float]:
    """Least-squares order of the errors of a kind of pixels, of how many points, the last one."""
    error_of, doubt_of = ("rmse", "reference_rmse")
    if kind != "all":
        error_of, doubt_of = f"rmse_{kind}", f"reference_{kind}"
    points = [
        (math.sqrt(row["rays_per_pixel"]), row[error_of])
        for row in curve
        if row.get(error_of) and row[error_of] >= 10 * (row.get(doubt_of) or 0.0)
    ]
    if len(points) < 2:
        return math.nan, len(points), math.nan
    side, error = np.log(np.array(points)).T
    return float(-np.polyfit(side, error, 1)[0]), len(points), points[-1][1]
