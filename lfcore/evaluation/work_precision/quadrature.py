"""The average over lens and pixel by few rays: grids, and strata, Halton and independent points."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from lfcore.evaluation.true_picture.reference import check_unlike
from lfcore.evaluation.work_precision import samples, windows
from lfcore.evaluation.work_precision.convergence import with_orders
from lfcore.evaluation.work_precision.measured_point import measured_point
from lfcore.evaluation.work_precision.study import Study
from lfcore.evaluation.work_precision.windows import Windows
from lfcore.optics.camera import Camera
from lfcore.optics.lattice import Lattice
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.rendering.direct import focused_camera, tile_sums
from lfcore.storage.layout import FrameLayout
from lfcore.tracing.tracer import Tracer

SEEDS, SEEDED_RAYS = 3, 256
"""Of random samples: seeds of pictures of at most so many rays a pixel.  More rays scatter little,
and have one seed.  The number of rays decides, so that every machine finds the same errors."""
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
    plane = SensorPlane(own.focus_m, own.f_number * 2 ** (stops / 2))
    camera = focused_camera(own, plane)
    where = windows.choose(tracer, camera, study.window_picture)
    truth, square_error = true_windows(tracer, camera, where, study.window_truth)
    context: dict[str, Any] = {"panel": "quadrature", "f_number": plane.f_number}
    context |= {
        f"reference_{name}": float(np.sqrt(square_error[mask].mean()))
        for name, mask in where.masks.items()
        if mask.any()
    }
    doubt = float(np.sqrt(square_error.mean()))
    for method in (MIDDLE, *samples.PATTERNS):
        curve, before = [], 0.0
        for views in study.views:
            if method != MIDDLE and 4 * before > LONGEST_SECONDS:
                break
            rays = _rays(camera, method, views)
            several = method in samples.RANDOM and rays <= SEEDED_RAYS
            work = partial(_picture, tracer, camera, where, method, views)
            row = measured_point(
                work, truth, doubt, seeds=SEEDS if several else 1, masks=where.masks,
                method=method, knob=f"N = {views}", rays_per_pixel=rays,
                **context,
            )  # fmt: skip
            curve.append(row)
            before = row["seconds"] or 0.0
        yield from with_orders(curve)


def true_windows(
    tracer: Tracer, camera: Camera, where: Windows, counts: Sequence[Sequence[int]]
) -> tuple[np.ndarray, np.ndarray]:
    """(W 16, 16, 3) float64 linear light, and (W 16, 16) its squared error, mean over channels.

    ``counts`` are two lattices, lens samples and rays of a pixel a side.
    """
    lattices = [Lattice(int(views), subpixels) for views, subpixels in counts]
    check_unlike(lattices)
    one, two = (
        samples.pictures(
            tracer, camera, where.pixels, samples.crossed(count.views), where.corners,
            windows.SIDE, subpixels=int(count.subpixels),
        )
        for count in lattices
    )  # fmt: skip
    truth = np.average([one, two], axis=0, weights=[count.rays_per_pixel for count in lattices])
    return truth, np.square(one - two).mean(axis=-1) / 2


def _rays(camera: Camera, method: str, views: int) -> int:
    """Of a pixel."""
    if method == MIDDLE:
        plane = SensorPlane(camera.focus_m, camera.f_number)
        return int(plane.mask(Slab(camera, views, 1)).sum())
    return len(samples.samples(method, views, 0).weight)


def _picture(
    tracer: Tracer, camera: Camera, where: Windows, method: str, views: int, seed: int
) -> np.ndarray:
    if method == MIDDLE:
        return grid(tracer, camera, where, views)
    points = samples.samples(method, views, seed)
    return samples.pictures(tracer, camera, where.pixels, points, where.corners, windows.SIDE)


def grid(tracer: Tracer, camera: Camera, where: Windows, views: int) -> np.ndarray:
    """(W 16, 16, 3) float64 linear light: the mean over a grid of ``views`` a side."""
    slab = Slab(camera, views, where.pixels)
    plane = SensorPlane(camera.focus_m, camera.f_number)
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
