"""The same picture by other ray tracers: POV-Ray and Mitsuba 3 (thesis figure 4.5).

Each renders the exported scene through the same lens with the same number of rays per pixel, on
one thread; lfcore also with more rays, spread over the pixels.  The reference is lfcore's, with
far more rays, spread over pixel and lens.  A missing renderer has a row with the reason.
"""

import functools
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lfcore.evaluation.metrics import picture_quality
from lfcore.evaluation.renderers.mitsuba import render_mitsuba
from lfcore.evaluation.renderers.povray import render_povray
from lfcore.evaluation.renderers.rendered import Rendered, or_left_out, timed
from lfcore.optics.planes import SensorPlane
from lfcore.rendering.direct import trace_picture
from lfcore.tracing.tracer import Tracer

REFERENCE_VIEWS = 20
"""The reference's lens samples per side."""
REFERENCE_PLACES = 4
"""The reference's places per pixel side: with 20 x 20 lens samples, 6400 rays per pixel."""
PLACES = 3
"""The places per pixel side of our second picture."""
ZOOM = 4
"""The enlargement of the detail, a square of 1/4 of the picture's side."""


def compare(
    tracer: Tracer, focus_m: Sequence[float], *, pixels: int, views: int
) -> tuple[list[dict], list[list[Rendered]]]:
    """Rows of the table, and all pictures of each focus distance.

    ``views`` squared is the number of rays per pixel.  ``tracer`` should have one thread, as the
    other renderers.  PSNR and SSIM are of sRGB codes that are not rounded, peak 255.
    """
    rows, all_rendered = [], []
    scene = tracer.scene
    methods = (
        *(functools.partial(_ours, tracer, places) for places in (1, PLACES)),
        *(functools.partial(or_left_out, *peer, scene) for peer in PEERS.items()),
    )
    for focus in focus_m:
        plane = SensorPlane(focus, scene.camera.f_number)
        truth = spread_picture(tracer, plane, pixels, REFERENCE_VIEWS, REFERENCE_PLACES)
        rendered = [method(plane, pixels, views) for method in methods]
        facts = {"scene": scene.name, "M": pixels, "focus_m": focus}
        rows += [facts | _row(result, truth) for result in rendered]
        all_rendered.append(rendered)
    return rows, all_rendered


def _row(result: Rendered, truth: np.ndarray) -> dict:
    measured: dict = dict.fromkeys(("psnr_db", "ssim", "seconds", "mrays_per_second"))
    if result.picture is not None:
        measured |= picture_quality([result.picture], [truth]) | {"seconds": result.seconds}
        measured["mrays_per_second"] = truth.shape[0] ** 2 * result.rays / result.seconds / 1e6
    return {"method": result.method, "rays_per_pixel": result.rays, **measured, "note": result.note}


def spread_picture(
    tracer: Tracer, plane: SensorPlane, pixels: int, views: int, places: int
) -> np.ndarray:
    """(M, M, 3) float32, linear light: the mean over ``places`` squared places in each pixel,
    each with ``views`` squared lens samples."""
    fine = trace_picture(tracer, tracer.scene.camera, places * pixels, plane, views=views)
    return fine.reshape(pixels, places, pixels, places, 3).mean((1, 3))


def _ours(tracer: Tracer, places: int, plane: SensorPlane, pixels: int, views: int) -> Rendered:
    work = functools.partial(spread_picture, tracer, plane, pixels, views, places)
    method, note = "lfcore", "one place per pixel, a grid over the lens"
    if places > 1:
        method += f", {places} x {places} places per pixel"
        note = "the same grid at each place"
    return timed(work, method, (places * views) ** 2, note)


PEERS = {"POV-Ray": render_povray, "Mitsuba 3": render_mitsuba}


def renderers_sheet(
    path: str | Path, rendered: Sequence[Sequence[Rendered]], focus_m: Sequence[float]
) -> None:
    """All pictures, a row per focus distance, above enlarged details."""
    from lfcore.evaluation.figures import Cell, contact_sheet, enlarged  # slow to import

    cells: list[Cell] = []
    for focus, row in zip(focus_m, rendered, strict=True):
        pictures = [(result.method, result.picture) for result in row if result.picture is not None]
        cells += [(picture, f"{method}, {focus:.3g} m") for method, picture in pictures]
        for _, picture in pictures:
            part = len(picture) // ZOOM
            detail = enlarged(picture, (len(picture) - part) // 2, part, len(picture))
            cells.append((detail, "detail"))
    contact_sheet(path, cells, len(cells) // (2 * len(focus_m)))
