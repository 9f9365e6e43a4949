"""All methods over cameras a side against a directly traced thin lens, and Monte Carlo's slope."""

import time

from matplotlib.figure import Figure

from lfcore.evaluation.camera_arrays import (
    array_record,
    convergence,
    fine_quadrature,
    reconstructions,
    square_field,
)
from lfcore.evaluation.figures import save_figure
from lfcore.files import write_json
from lfcore.rendering.photograph import direct_thin_lens
from workflow.assignment import ARRAYS, BOOK_FOCUS_M, measured_camera
from workflow.job import job
from workflow.tracer import open_tracer

SAMPLES = 4
SAMPLERS = ("independent", "stratified", "halton")
CONVERGENCE_COUNTS = (4, 16, 64, 256)
CONVERGENCE_PX = 64
CONVERGENCE_CAMERAS = 16


def draw(path, rows, slopes):
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
    save_figure(path, figure)


with job(snakemake):
    params = snakemake.params
    tracer = open_tracer(snakemake)
    camera = measured_camera(params.picture_px)
    reference = direct_thin_lens(tracer, camera, BOOK_FOCUS_M, params.reference_samples)
    # A reference of half the rays says how far the reference itself can be trusted.
    half = direct_thin_lens(tracer, camera, BOOK_FOCUS_M, max(1, params.reference_samples // 2))
    rows, arrays = [], []
    # Kernels are built for the size of a tile: unseen by the clock.
    square_field(tracer, 2, *ARRAYS["book"], params.tile_px, 1)
    for cameras in sorted(params.camera_counts):
        begun = time.perf_counter()
        field = square_field(tracer, cameras, *ARRAYS["book"], params.tile_px, SAMPLES)
        arrays.append(array_record("book", field, SAMPLES, time.perf_counter() - begun))
        found = reconstructions(
            field, camera, BOOK_FOCUS_M, reference, samples=sorted(params.monte_carlo_samples)
        )
        rows += [{"scene": "book", **row} for row in found]
        print(found)
        del field
    field = square_field(tracer, CONVERGENCE_CAMERAS, *ARRAYS["book"], params.tile_px, SAMPLES)
    small = measured_camera(CONVERGENCE_PX)
    limit = fine_quadrature(field, small, BOOK_FOCUS_M)
    slopes = {
        sampler: convergence(
            field, small, BOOK_FOCUS_M, CONVERGENCE_COUNTS, sampler=sampler, limit=limit
        )
        for sampler in SAMPLERS
    }
    draw(snakemake.output.figure, rows, slopes)
    record = {"rows": rows, "arrays": arrays, "convergence": slopes}
    record["tile_px"] = params.tile_px
    record["reference_rmse"] = float(((half - reference) ** 2).mean() ** 0.5)
    write_json(snakemake.output.record, record)
    print(slopes)
