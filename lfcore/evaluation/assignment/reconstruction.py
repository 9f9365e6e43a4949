"""All methods over cameras per side against a directly traced thin lens, and Monte Carlo's slope.

Source: CS348b assignment 3, steps 4 and 6.
"""

import math
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from matplotlib.figure import Figure

from lfcore.errors import LfcoreError
from lfcore.evaluation.assignment.arrays import array_record, errors, exr_bytes, square_field
from lfcore.evaluation.assignment.book import BOOK_FOCUS_M, measured_camera
from lfcore.evaluation.metrics import mse
from lfcore.opencl.device import programs_made
from lfcore.refocus.array.device_field import DeviceField
from lfcore.refocus.array.focal_surface import parallel
from lfcore.refocus.array.isaksen import isaksen
from lfcore.refocus.array.monte_carlo import monte_carlo
from lfcore.refocus.array.quadrature import quadrature
from lfcore.refocus.array.virtual_camera import VirtualCamera
from lfcore.rendering.photograph import direct_thin_lens
from lfcore.timing import clocked, clocked_warm
from lfcore.tracing.tracer import Tracer

FILTERS = (1.0, 2.0)
"""Isaksen's filter over the lens radius.  The cone of twice the radius spreads about as the disk of
the lens does; that of one radius has its support."""
LENS_POINTS = 8
"""Points per side of the quadrature's lens rule; 2 x 2 points on the film."""
FINE_LENS, FINE_FILM = 24, 8
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

    ``reference_samples`` are the rays per pixel of the picture that is traced directly.
    """
    bounds, fov_deg = grid["bounds_m"], grid["fov_deg"]
    camera = measured_camera(picture_px)
    reference = direct_thin_lens(tracer, camera, BOOK_FOCUS_M, reference_samples)
    # A reference with half the rays estimates the reference's own error.
    half = direct_thin_lens(tracer, camera, BOOK_FOCUS_M, max(1, reference_samples // 2))
    rows, arrays = [], []
    # Kernels are built for the size of a tile: unseen by the clock.
    square_field(tracer, 2, bounds, fov_deg, tile_px, 1)
    for cameras in sorted(camera_counts):
        tracing = partial(square_field, tracer, cameras, bounds, fov_deg, tile_px, SAMPLES)
        field, seconds = clocked(tracing)
        size = exr_bytes(field)
        arrays.append(array_record(tracer.scene.name, field.array, SAMPLES, seconds, size))
        samples = sorted(monte_carlo_samples)
        found = reconstructions(field, camera, BOOK_FOCUS_M, reference, samples)
        rows += [{"scene": tracer.scene.name, **row} for row in found]
        del field
    field = square_field(tracer, CONVERGENCE_CAMERAS, bounds, fov_deg, tile_px, SAMPLES)
    small = measured_camera(CONVERGENCE_PX)
    slopes = convergence(field, small, BOOK_FOCUS_M, convergence_samples)
    record = {"rows": rows, "arrays": arrays, "convergence": slopes, "tile_px": tile_px}
    return record | {"reference_rmse": errors(half, reference)["rmse"]}


def reconstructions(
    field: DeviceField,
    camera: VirtualCamera,
    focus_z: float,
    reference: np.ndarray,
    samples: Sequence[int],
) -> list[dict]:
    """Every method on one array against a reference: rows of the ``reconstruction`` table.

    ``samples`` are Monte Carlo's rays per pixel (Halton).
    """
    given = field, camera, parallel(focus_z)
    radii = [factor * camera.lens_radius_m for factor in FILTERS]
    ways = [
        *(("isaksen", f"{radius:g} m", partial(isaksen, *given, radius)) for radius in radii),
        *(("monte_carlo", str(n), partial(monte_carlo, *given, n)) for n in samples),
        ("quadrature", str(4 * LENS_POINTS**2), partial(quadrature, *given, LENS_POINTS)),
    ]
    rows = []
    for method, label, way in ways:
        made, seconds = clocked_warm(way, programs_made)
        row = {"cameras_per_dim": field.array.cameras[0], "method": method}
        row |= {"filter_or_samples": label, **errors(made.image, reference), "seconds": seconds}
        rows.append(row)
    return rows


def convergence(
    field: DeviceField,
    camera: VirtualCamera,
    focus_z: float,
    counts: Sequence[int],
) -> dict[str, dict]:
    """Monte Carlo against its limit, by sampler: ``counts``, ``rmse``, their log-log ``slope``.

    The limit is the picture of FINE_LENS^2 lens and FINE_FILM^2 film points.  On the book's array
    of 16 x 16 cameras it differs from 40^2 lens points by an RMSE of 3e-5; with 4^2 film points it
    would differ by 9e-4, as much as Monte Carlo at 256 rays.
    """
    given = field, camera, parallel(focus_z)
    limit = quadrature(*given, FINE_LENS, FINE_FILM).image
    made = {}
    for sampler in SAMPLERS:
        pictures = (monte_carlo(*given, count, sampler=sampler).image for count in counts)
        rmse = [math.sqrt(mse(picture, limit)) for picture in pictures]
        made[sampler] = {"counts": list(counts), "rmse": rmse, "slope": slope(counts, rmse)}
    return made


def slope(counts: Sequence[float], values: Sequence[float]) -> float:
    """Exponent p of ``values ~ counts^p``, by least squares on logarithms.

    Raises :class:`LfcoreError` for fewer than two different counts, or a value that is not
    positive.
    """
    if len(set(counts)) < 2 or len(counts) != len(values) or min(*counts, *values) <= 0:
        raise LfcoreError(
            "a slope needs positive values at two or more counts",
            key="monte_carlo_samples",
            remedy="Give at least two different numbers of samples",
        )
    return float(np.polyfit(np.log(counts), np.log(values), 1)[0])


def reconstruction_figure(rows: Sequence[Mapping], slopes: Mapping[str, Mapping]) -> Figure:
    """Error over run time, one curve a method; error over samples, one curve a sampler."""
    figure = Figure(figsize=(11, 4.4))
    left, right = figure.subplots(1, 2)
    for index, cameras in enumerate(sorted({row["cameras_per_dim"] for row in rows})):
        for method, mark in (("isaksen", "s"), ("monte_carlo", "o"), ("quadrature", "^")):
            part = [r for r in rows if (r["cameras_per_dim"], r["method"]) == (cameras, method)]
            line = "-" if method == "monte_carlo" else ""
            times, values = [r["seconds"] for r in part], [r["rmse"] for r in part]
            left.plot(times, values, mark + line, color=f"C{index}", markersize=5)
        left.plot([], [], "-", color=f"C{index}", label=f"{cameras} cameras per side")
    for method, mark in (("Isaksen", "s"), ("Monte Carlo", "o"), ("quadrature", "^")):
        left.plot([], [], mark, color="0.4", label=method)
    left.set(xlabel="seconds", ylabel="RMSE against the traced thin lens")
    for sampler, found in slopes.items():
        label = f"{sampler}, slope {found['slope']:.2f}"
        right.plot(found["counts"], found["rmse"], "o-", label=label)
    right.set(xlabel="rays per pixel", ylabel="RMSE against the fine quadrature")
    for axis in (left, right):
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.legend(fontsize=8)
    return figure
