"""One refocused picture by four methods (thesis sections 3.3, 4.3 and 6.3).

Slicing while tracing, shift-sum of views and shift-sum of a plenoptic photograph, against the
picture traced directly at its own focus with 4096 rays per pixel.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from lfcore.colour import display_values
from lfcore.evaluation.metrics import PEAK, picture_quality, psnr
from lfcore.evaluation.work_precision.in_memory import trace_views
from lfcore.opencl.device import programs_made
from lfcore.optics.planes import SensorPlane
from lfcore.optics.plenoptic import PlenopticCamera
from lfcore.optics.slab import Slab
from lfcore.refocus.resampling import FILTERS, coverage
from lfcore.refocus.shift_sum import shift_sum_views
from lfcore.rendering.direct import trace_picture, trace_planes
from lfcore.rendering.plenoptic import photograph, refocus_photograph
from lfcore.timing import clocked_warm
from lfcore.tracing.tracer import Tracer

Planes = Sequence[SensorPlane]
EDGE_SHARE = 0.1
"""The share of pixels that count as edges: the steepest of the reference."""


class Result(NamedTuple):
    """Pictures (P, M, M, 3) of linear light by one method, and the seconds of its parts.

    Seconds are sums over all planes; ``trace`` is 0 if tracing is not timed separately.
    """

    method: str
    filter: str
    pictures: np.ndarray
    trace: float
    refocus: float


def equivalence(
    tracer: Tracer, planes: Planes, *, views: int, pixels: int, reference_views: int = 64
) -> tuple[list[dict], list[Result]]:
    """Rows of every plane and method, the reference's last, and the pictures, the reference first.

    The scene's camera records N x N = ``views`` squared; the plenoptic camera has as many pixels
    per microlens.  ``psnr_inside_db`` ignores pixels for which the light field lacks rays;
    ``error_at_edges`` is the share of the squared error in the steepest tenth of the reference (0.1
    for uniform errors).  ``seconds`` are per picture.  Raises :class:`OpticsError` for a plane that
    the camera does not record, or too coarse microlenses.
    """
    slab = Slab(tracer.scene.camera, views, pixels)
    for plane in planes:
        plane.check(slab)
    trace = partial(trace_picture, tracer, slab.camera, slab.pixels, views=reference_views)
    # The program is built before the clock starts: a timed run that builds it would be repeated.
    trace_picture(tracer, slab.camera, 8, planes[0], views=reference_views)
    slicing = partial(trace_planes, tracer, slab, planes)
    truth = _traced("traced directly", "none", lambda: np.stack([*map(trace, planes)]))
    sliced = _traced("slicing the slab", "nearest", slicing)
    results = [truth, sliced, *_views(tracer, slab, planes), *_plenoptic(tracer, slab, planes)]
    rows: list[dict] = []
    for result in [*results[1:], truth]:
        rays = (reference_views if result is truth else views) ** 2
        rows += _rows(tracer.scene.name, slab, planes, result, truth.pictures, rays)
    return rows, results


def _traced(method: str, filter: str, work: Callable[[], np.ndarray]) -> Result:
    pictures, seconds = clocked_warm(work, programs_made)
    return Result(method, filter, pictures, seconds, 0.0)


def _views(tracer: Tracer, slab: Slab, planes: Planes) -> Iterator[Result]:
    views, trace = clocked_warm(partial(trace_views, tracer, slab), programs_made)
    sum_views = partial(shift_sum_views, slab, views, planes, device=tracer.device)
    return _by_filter("shift-sum on views", sum_views, trace)


def _plenoptic(tracer: Tracer, slab: Slab, planes: Planes) -> Iterator[Result]:
    camera = PlenopticCamera(slab.camera, slab.pixels, slab.views)
    picture, trace = clocked_warm(partial(photograph, tracer, camera), programs_made)
    refocus = partial(refocus_photograph, camera, picture, planes, device=tracer.device)
    return _by_filter("shift-sum on the plenoptic photograph", refocus, trace)


def _by_filter(method: str, refocus: Callable[..., np.ndarray], trace: float) -> Iterator[Result]:
    for name in FILTERS:
        pictures, seconds = clocked_warm(partial(refocus, filter=name), programs_made)
        yield Result(method, name, pictures, trace, seconds)


def _rows(
    scene: str, slab: Slab, planes: Planes, result: Result, reference: np.ndarray, rays: int
) -> Iterator[dict]:
    for plane, picture, truth in zip(planes, result.pictures, reference, strict=True):
        ours, theirs = display_values(picture), display_values(truth)
        quality = picture_quality([picture], [truth])
        # Pixels to which every open view contributes in full.
        inside = coverage(slab, plane, "bilinear") > plane.mask(slab).sum() * (1 - 1e-6)
        inner = psnr(ours[inside], theirs[inside], peak=PEAK) if inside.any() else None
        trace, refocus = result.trace / len(planes), result.refocus / len(planes)
        yield {
            "scene": scene,
            "N": slab.views,
            "M": slab.pixels,
            "focus_m": plane.focus_m,
            "f_number": plane.f_number,
            "method": result.method,
            "filter": result.filter,
            "rays_per_pixel": rays,
            "psnr_db": quality["psnr_db"],
            "psnr_inside_db": inner,
            "ssim": quality["ssim"],
            "error_at_edges": _error_at_edges(ours, theirs),
            "trace_seconds": trace,
            "refocus_seconds": refocus,
            "seconds": trace + refocus,
        }


def _error_at_edges(ours: np.ndarray, theirs: np.ndarray) -> float | None:
    """The share of the squared error in the steepest part of the reference; None without error."""
    error = np.square(ours - theirs).sum(axis=-1)
    if not error.any():
        return None
    slopes = np.gradient(theirs.mean(axis=-1))
    steep = np.hypot(*slopes)
    count = max(1, round(EDGE_SHARE * steep.size))
    where = np.argsort(steep, axis=None)[-count:]
    return float(error.reshape(-1)[where].sum() / error.sum())
