"""One refocused picture, traced: thousands of rays that miss parts of a pixel, or few by depth."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from lfcore.evaluation.true_picture.reference import Reference, true_pictures
from lfcore.evaluation.work_precision.measured_point import measured_point
from lfcore.evaluation.work_precision.study import Study
from lfcore.optics.lattice import Lattice
from lfcore.optics.planes import SensorPlane
from lfcore.optics.ray_cells import crossed_views
from lfcore.optics.slab import Slab
from lfcore.refocus.resampling import coverage
from lfcore.rendering.by_depth import trace_by_depth
from lfcore.rendering.direct import trace_planes
from lfcore.tracing.tracer import Tracer

BY_DEPTH = Lattice(4, 1), Lattice(4, 1.5), Lattice(4, 2), Lattice(8, 2)


def refocused_picture(tracer: Tracer, pixels: int, counts: Sequence[Sequence[float]]) -> Reference:
    """The true picture at the scene's nearest distance, where all rays are recorded.

    ``counts`` are two unlike lattices, lens samples and rays of a pixel a side.
    """
    scene = tracer.scene
    plane = SensorPlane(min(scene.focus_distances_m), scene.camera.f_number)
    lattices = [Lattice(int(views), subpixels) for views, subpixels in counts]
    return true_pictures(tracer, [plane], pixels, lattices)


def refocused_row(
    truth: Reference,
    panel: str,
    method: str,
    knob: str,
    slab: Slab,
    work: Callable[[int], Any],
    *,
    subpixels: float = 1,
    **more: Any,
) -> dict:
    """A point of ``work``'s picture, of the pixels that all of the lens sees.

    ``slab`` has the lens samples, each with ``subpixels`` rays of a pixel's side.
    """
    (plane,) = truth.planes
    inside = _inside(Slab(slab.camera, 64, slab.pixels), plane) & _inside(slab, plane)
    doubt = float(np.sqrt(truth.square_error[0, inside].mean()))
    return measured_point(
        work, truth.pictures[0].astype(float), doubt,
        panel=panel, f_number=plane.f_number, method=method, knob=knob, inside=inside,
        rays_per_pixel=round(plane.mask(slab).sum() * subpixels**2), **more,
    )  # fmt: skip


def _inside(slab: Slab, plane: SensorPlane) -> np.ndarray:
    return coverage(slab, plane, "bilinear") > plane.mask(slab).sum() * (1 - 1e-6)


def tracing(tracer: Tracer, study: Study, truth: Reference) -> Iterator[dict]:
    """The thesis's recipe by N, and rays that are spread by their depth; tracing counts."""
    camera, pixels, plane = tracer.scene.camera, study.pixels, truth.planes[0]
    for views in study.views:
        slab = Slab(camera, views, pixels)
        work = lambda _, slab=slab: trace_planes(tracer, slab, [plane])[0]  # noqa: E731
        yield refocused_row(truth, "tracing", "nearest pixel", f"N = {views}", slab, work)
    for count in BY_DEPTH:
        crossed = crossed_views(Slab(camera, count.views, count.side(pixels)))
        work = lambda _, crossed=crossed: (  # noqa: E731
            trace_by_depth(tracer, crossed, [plane], pixels)[0]
        )
        yield refocused_row(
            truth, "tracing", "by depth", str(count), Slab(camera, count.views, pixels), work,
            subpixels=count.subpixels,
        )  # fmt: skip
