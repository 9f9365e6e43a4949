"""All methods over cameras per side against a directly traced thin lens, and Monte Carlo's slope.

Then studies: seeing through, few and many cameras, a shutter sampled in time.  Each returns sheets
of pictures and the measurements.  Source: CS348b assignment 3, steps 4 and 6.
"""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from lfcore.evaluation.assignment.arrays import (
    array_of,
    array_record,
    errors,
    exr_bytes,
    read_field,
    square_field,
)
from lfcore.evaluation.assignment.book import AUTHORS_FOCUS_M, BOOK_FOCUS_M, measured_camera
from lfcore.evaluation.figures import Sheet
from lfcore.evaluation.metrics import mse
from lfcore.opencl.device import Device, programs_made
from lfcore.readers.pbrt.build import build_pbrt_scene
from lfcore.refocus.array.device_field import DeviceField, Synthesis
from lfcore.refocus.array.focal_surface import parallel
from lfcore.refocus.array.synthesis import isaksen, monte_carlo, quadrature
from lfcore.refocus.array.virtual_camera import VirtualCamera
from lfcore.rendering.photograph import direct_thin_lens, trace_shutter
from lfcore.timing import clocked, clocked_warm
from lfcore.tracing.tracer import Tracer

FILTERS = (1.0, 2.0)
"""The radii of Isaksen's filter in lens radii: 1 has the lens's support; 2 blurs about as much as
the lens's disk."""
LENS_POINTS = 8
"""Points per side of the quadrature's lens rule; 2 x 2 points on the film."""
FINE_LENS = 24
"""Lens points per side of pictures without visible noise."""
LIMIT_LENS = 16
"""Lens points per side of the picture that samplers converge to."""
FINE_FILM = 8
"""Film points per side of a pixel of that picture."""
SAMPLES = 4
"""Rays per pixel of traced arrays."""
SAMPLERS = ("independent", "stratified", "halton")
CONVERGENCE_PX = 64
CONVERGENCE_CAMERAS = 16
STYLES = {
    "isaksen": ("Isaksen", "s"), "monte_carlo": ("Monte Carlo", "o-"),
    "quadrature": ("quadrature", "^"),
}  # fmt: skip
"""The name and the marks of each method in the figure."""


def reconstruction(
    tracer: Tracer,
    *,
    grid: Mapping,
    picture_px: int,
    tile_px: int,
    camera_counts: Sequence[int],
    monte_carlo_samples: Sequence[int],
    convergence_samples: Sequence[int],
    reference_samples: int,
) -> tuple[list[Figure], dict]:
    """``rows`` of the table, the traced ``arrays``, and ``convergence`` by sampler.

    ``reference_samples`` are the rays per pixel of the directly traced picture.
    """
    camera = measured_camera(picture_px)
    reference = direct_thin_lens(tracer, camera, BOOK_FOCUS_M, reference_samples)
    # A reference with half the rays estimates the reference's error.
    half = direct_thin_lens(tracer, camera, BOOK_FOCUS_M, max(1, reference_samples // 2))
    rows, arrays = [], []
    # Kernels are built per tile size, before the clock starts.
    square_field(tracer, grid, 2, tile_px, 1)
    for cameras in sorted(camera_counts):
        tracing = partial(square_field, tracer, grid, cameras, tile_px, SAMPLES)
        field, seconds = clocked(tracing)
        size = exr_bytes(field)
        arrays.append(array_record(tracer.scene.name, field.array, SAMPLES, seconds, size))
        samples = sorted(monte_carlo_samples)
        by_method = reconstructions(field, camera, BOOK_FOCUS_M, reference, samples)
        rows += [{"scene": tracer.scene.name, **row} for row in by_method]
        del field
    field = square_field(tracer, grid, CONVERGENCE_CAMERAS, tile_px, SAMPLES)
    small = measured_camera(CONVERGENCE_PX)
    slopes = convergence(field, small, BOOK_FOCUS_M, convergence_samples)
    record = {"rows": rows, "arrays": arrays, "convergence": slopes, "tile_px": tile_px}
    record |= {"reference_rmse": errors(half, reference)["rmse"]}
    return [reconstruction_figure(rows, slopes)], record


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
    view = field, camera, parallel(focus_z)
    radii = [factor * camera.lens_radius_m for factor in FILTERS]
    methods = [
        *(("isaksen", f"{radius:g} m", partial(isaksen, *view, radius)) for radius in radii),
        *(("monte_carlo", str(n), partial(monte_carlo, *view, n)) for n in samples),
        ("quadrature", str(4 * LENS_POINTS**2), partial(quadrature, *view, LENS_POINTS)),
    ]
    rows = []
    for method, label, work in methods:
        result, seconds = clocked_warm(work, programs_made)
        row = {"cameras_per_dim": field.array.cameras[0], "method": method}
        row |= {"filter_or_samples": label, **errors(result.image, reference), "seconds": seconds}
        rows.append(row)
    return rows


def convergence(
    field: DeviceField, camera: VirtualCamera, focus_z: float, counts: Sequence[int]
) -> dict[str, dict]:
    """Monte Carlo against its limit, by sampler: ``counts``, ``rmse``, their log-log ``slope``.

    The limit is the picture of LIMIT_LENS^2 lens and FINE_FILM^2 film points.  On the book's array
    of 16 x 16 cameras it differs from 32^2 lens points by an RMSE of 6e-5; with 4^2 film points it
    would differ by 9e-4, as much as Monte Carlo at 256 rays.
    """
    view = field, camera, parallel(focus_z)
    limit = quadrature(*view, LIMIT_LENS, FINE_FILM).image
    by_sampler = {}
    for sampler in SAMPLERS:
        pictures = (monte_carlo(*view, count, sampler=sampler).image for count in counts)
        rmse = [math.sqrt(mse(picture, limit)) for picture in pictures]
        by_sampler[sampler] = {"counts": list(counts), "rmse": rmse, "slope": slope(counts, rmse)}
    return by_sampler


def slope(counts: Sequence[float], values: Sequence[float]) -> float:
    """Exponent p of ``values ~ counts^p``, by least squares on logarithms."""
    return float(np.polyfit(np.log(counts), np.log(values), 1)[0])


def reconstruction_figure(rows: Sequence[Mapping], slopes: Mapping[str, Mapping]) -> Figure:
    """Error over run time, one curve per method; error over samples, one curve per sampler."""
    figure = Figure(figsize=(11, 4.4))
    left, right = figure.subplots(1, 2)
    for index, (cameras, group) in enumerate(pd.DataFrame(rows).groupby("cameras_per_dim")):
        for method, (_, style) in STYLES.items():
            part = group[group.method == method]
            left.plot(part.seconds, part.rmse, style, color=f"C{index}", markersize=5)
        left.plot([], [], "-", color=f"C{index}", label=f"{cameras} cameras per side")
    for name, style in STYLES.values():
        left.plot([], [], style[0], color="0.4", label=name)
    left.set(xlabel="seconds", ylabel="RMSE against the traced thin lens")
    for sampler, curve in slopes.items():
        label = f"{sampler}, slope {curve['slope']:.2f}"
        right.plot(curve["counts"], curve["rmse"], "o-", label=label)
    right.set(xlabel="rays per pixel", ylabel="RMSE against the fine quadrature")
    for axis in (left, right):
        axis.set(xscale="log", yscale="log")
        axis.legend(fontsize=8)
    return figure


FOV_DEG = 50.0
"""The field of view of pictures that see through objects."""
FEW = (2, 4, 8, 16)
"""Cameras per side of arrays of few cameras."""
MANY = (4, 8, 16, 32, 64, 128)
"""Cameras per side of arrays of equal storage."""
SMALLEST_TILE = 4
"""The fewest pixels per side of a camera."""
SHUTTER_FOCUS_M = 5.4
"""The distance from the cameras to the near side of the moving sphere."""
SHUTTER_LENS_M = 0.2
"""The radius of the lens before the moving sphere."""


def see_through(
    tracer: Tracer,
    *,
    light_field: str | Path,
    study: Mapping,
    picture_px: int,
    reference_samples: int,
) -> tuple[list[Sheet], dict]:
    """Step 4: a wide lens, focused on the background, sees through nearer objects.

    From the ``light_field`` of the tracer's scene, a tiled EXR, and the background directly, with
    ``reference_samples`` rays per pixel.  ``study`` has ``focus_m`` of the background and of nearer
    objects, nearest first, ``lens_m``, the radius of the lens at each, and ``names``.
    """
    field = read_field(tracer.device, light_field)
    named = list(zip(study["names"], study["focus_m"], study["lens_m"], strict=True))
    (_, focus, lens), near = named[0], named[1:]

    def camera(radius: float) -> VirtualCamera:
        """A camera at the middle of the grid, in the array's direction."""
        return VirtualCamera(np.zeros(3), np.eye(3), FOV_DEG, 2 * (picture_px,), radius)

    def from_field(focus_m: float, radius: float) -> tuple[Synthesis, float]:
        view = field, camera(radius), parallel(focus_m), FINE_LENS, 2
        return clocked_warm(lambda: quadrature(*view), programs_made)

    direct, direct_seconds = clocked(
        lambda: direct_thin_lens(tracer, camera(lens), focus, reference_samples)
    )
    (pinhole, _), (through, seconds) = from_field(focus, 0.0), from_field(focus, lens)
    cells = [
        (pinhole.image, "light field, pinhole"),
        (through.image, f"light field, focus {focus:g} m"),
        (direct, f"traced directly, focus {focus:g} m"),
    ]
    for name, focus_m, radius in near:
        cells.append((from_field(focus_m, radius)[0].image, f"{name}, focus {focus_m:g} m"))
    columns = field.array.columns_m
    spacing = columns[1] - columns[0]
    measured = {
        **errors(through.image, direct),
        "pinhole_psnr_db": errors(pinhole.image, direct)["psnr_db"],
        "seconds": seconds,
        "direct_seconds": direct_seconds,
        "direct_samples": reference_samples,
        "names": list(study["names"]),
        "lens_m": dict(zip(study["names"], study["lens_m"], strict=True)),
        "focus_m": dict(zip(study["names"], study["focus_m"], strict=True)),
        "spacing_m": spacing,
        # Disparity of the nearest object between neighbouring cameras aimed at the background.
        "jump_px": spacing * abs(1 / near[0][1] - 1 / focus) / field.array.pixel_pitch,
    }
    return [Sheet(cells, 3)], measured


def sampling(
    tracer: Tracer,
    *,
    grid: Mapping,
    picture_px: int,
    tile_px: int,
    storage_px: int,
    reference_samples: int,
) -> tuple[list[Sheet], dict]:
    """Step 6: few cameras of ``tile_px``; many that share ``storage_px`` pixels per side.

    The directly traced picture, with ``reference_samples`` rays per pixel, is last on each sheet.
    """
    camera = measured_camera(picture_px)
    reference = direct_thin_lens(tracer, camera, AUTHORS_FOCUS_M, reference_samples)
    few = [(cameras, tile_px) for cameras in FEW]
    many = [(cameras, storage_px // cameras) for cameras in MANY]
    of_few, few_rows = _compared(tracer, grid, camera, reference, few)
    of_many, many_rows = _compared(tracer, grid, camera, reference, many)
    return [of_few, of_many], {"storage_px": storage_px, "few": few_rows, "many": many_rows}


def _compared(
    tracer: Tracer,
    grid: Mapping,
    camera: VirtualCamera,
    reference: np.ndarray,
    sizes: Sequence[tuple[int, int]],
) -> tuple[Sheet, list[dict]]:
    """Arrays by cameras per side and pixels per camera; tiny pictures are skipped."""
    cells, records = [], []
    for cameras, tile in sizes:
        if tile < SMALLEST_TILE:
            continue
        field = square_field(tracer, grid, cameras, tile, SAMPLES)
        picture = quadrature(field, camera, parallel(AUTHORS_FOCUS_M), FINE_LENS, 2).image
        quality = errors(picture, reference)
        label = f"{cameras} x {cameras} of {tile} x {tile}: {quality['psnr_db']:.1f} dB"
        cells.append((picture, label))
        records.append({"cameras_per_dim": cameras, "tile_px": tile, **quality})
    columns = len(cells) // 2 + 1
    return Sheet([*cells, (reference, "traced directly")], columns), records


def time(
    device: Device, *, files: Sequence[str | Path], picture_px: int, instants: int
) -> tuple[list[Sheet], dict]:
    """Step 6: an open shutter before moving objects, sampled at more and more instants.

    Errors are against the picture of the most instants.  ``files`` are a pbrt scene with a camera
    array and the files that it includes.
    """
    scene = build_pbrt_scene(files[0])
    array = array_of(scene, None, 0, None)
    size = (picture_px, picture_px)
    camera = VirtualCamera(np.zeros(3), np.eye(3), 40.0, size, SHUTTER_LENS_M)
    counts = [1, *(n for n in (2, 4, 8, 16, 32, 64) if n < instants), instants]
    pictures, seconds = [], []
    for count in counts:
        image, spent = clocked(partial(trace_shutter, scene, array, count, device=device))
        seconds.append(spent)
        field = DeviceField(device, image, array)
        pictures.append(quadrature(field, camera, parallel(SHUTTER_FOCUS_M), 16, 2).image)
    differences = [errors(picture, pictures[-1]) for picture in pictures[:-1]]
    labels = [
        f"{count} instant{'s' * (count > 1)}: {error['psnr_db']:.1f} dB"
        for count, error in zip(counts, differences, strict=False)
    ]
    labels.append(f"{counts[-1]} instants")
    record = {
        "counts": counts,
        "seconds": seconds,
        "rmse": [error["rmse"] for error in differences],
    }
    return [Sheet(list(zip(pictures, labels, strict=True)), 3)], record
