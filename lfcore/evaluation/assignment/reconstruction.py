"""All methods over cameras a side against a directly traced thin lens, and Monte Carlo's slope."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure

from lfcore.evaluation.assignment.book import BOOK_FOCUS_M, measured_camera
from lfcore.evaluation.camera_arrays import (
    array_record,
    convergence,
    errors,
    exr_bytes,
    fine_quadrature,
    reconstructions,
    square_field,
)
from lfcore.evaluation.timing import clocked
from lfcore.rendering.photograph import direct_thin_lens
from lfcore.tracing.tracer import Tracer

SAMPLES = 4
SAMPLERS = ("independent", "stratified", "halton")
CONVERGENCE_PX = 64
CONVERGENCE_CAMERAS = 16


def reconstruction(
    tracer: Tracer,
    grid: Mapping,
    *,
    picture_px: int,
    tile_px: int,
    camera_counts: Sequence[int],
    monte_carlo_samples: Sequence[int],
    convergence_samples: Sequence[int],
    reference_samples: int,
) -> dict:
    """``rows`` of the table, ``arrays`` that were traced for it, ``convergence`` by sampler.

    Parameters
    ----------
    grid : ``bounds_m`` and ``fov_deg`` of the cameras.
    reference_samples : rays a pixel of the picture that is traced directly.
    """
    bounds, fov_deg = grid["bounds_m"], grid["fov_deg"]
    camera = measured_camera(picture_px)
    reference = direct_thin_lens(tracer, camera, BOOK_FOCUS_M, reference_samples)
    # A reference of half the rays says how far the reference itself can be trusted.
    half = direct_thin_lens(tracer, camera, BOOK_FOCUS_M, max(1, reference_samples // 2))
    rows, arrays = [], []
    # Kernels are built for the size of a tile: unseen by the clock.
    square_field(tracer, 2, bounds, fov_deg, tile_px, 1)
    for cameras in sorted(camera_counts):
        field, seconds = clocked(
            lambda cameras=cameras: square_field(tracer, cameras, bounds, fov_deg, tile_px, SAMPLES)
        )
        size = exr_bytes(field)
        arrays.append(array_record(tracer.scene.name, field.array, SAMPLES, seconds, size))
        found = reconstructions(
            field, camera, BOOK_FOCUS_M, reference, samples=sorted(monte_carlo_samples)
        )
        rows += [{"scene": tracer.scene.name, **row} for row in found]
        del field
    field = square_field(tracer, CONVERGENCE_CAMERAS, bounds, fov_deg, tile_px, SAMPLES)
    small = measured_camera(CONVERGENCE_PX)
    limit = fine_quadrature(field, small, BOOK_FOCUS_M)
    slopes = {
        sampler: convergence(
            field, small, BOOK_FOCUS_M, convergence_samples, sampler=sampler, limit=limit
        )
        for sampler in SAMPLERS
    }
    record = {"rows": rows, "arrays": arrays, "convergence": slopes, "tile_px": tile_px}
    return record | {"reference_rmse": errors(half, reference)["rmse"]}


def reconstruction_figure(rows: Sequence[Mapping], slopes: Mapping[str, Mapping]) -> Figure:
    """Error over run time, one curve a method; error over samples, one curve a sampler."""
    figure = Figure(figsize=(11, 4.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    for index, cameras in enumerate(sorted({row["cameras_per_dim"] for row in rows})):
        for method, mark in (("isaksen", "s"), ("monte_carlo", "o"), ("quadrature", "^")):
            part = [r for r in rows if (r["cameras_per_dim"], r["method"]) == (cameras, method)]
            line = "-" if method == "monte_carlo" else ""
            times, values = [r["seconds"] for r in part], [r["rmse"] for r in part]
            left.plot(times, values, mark + line, color=f"C{index}", markersize=5)
        left.plot([], [], "-", color=f"C{index}", label=f"{cameras} cameras a side")
    for method, mark in (("Isaksen", "s"), ("Monte Carlo", "o"), ("quadrature", "^")):
        left.plot([], [], mark, color="0.4", label=method)
    left.set(xlabel="seconds", ylabel="RMSE against the traced thin lens")
    for sampler, found in slopes.items():
        label = f"{sampler}, slope {found['slope']:.2f}"
        right.plot(found["counts"], found["rmse"], "o-", label=label)
    right.set(xlabel="rays a pixel", ylabel="RMSE against the fine quadrature")
    for axis in (left, right):
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.grid(alpha=0.3)
        axis.legend(frameon=False, fontsize=8)
    return figure
