"""Measurements on camera arrays: pictures from them against a directly traced thin lens.

Source: CS348b assignment 3, steps 4 and 6.  Errors are of linear radiance (RMSE) and of sRGB codes
(PSNR, the convention of :mod:`lfcore.evaluation.metrics`).
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from operator import itemgetter
from pathlib import Path

import numpy as np
import pandas as pd

from lfcore.colour import display_values
from lfcore.errors import LfcoreError
from lfcore.evaluation.metrics import mse, psnr
from lfcore.evaluation.timing import clocked
from lfcore.optics.array import CameraArray
from lfcore.refocus.array.device_field import DeviceField
from lfcore.refocus.array.focal_surface import parallel
from lfcore.refocus.array.isaksen import isaksen
from lfcore.refocus.array.monte_carlo import monte_carlo
from lfcore.refocus.array.quadrature import quadrature
from lfcore.refocus.array.virtual_camera import VirtualCamera
from lfcore.rendering.array import trace_array
from lfcore.storage.tiled_exr import write_array
from lfcore.tracing.tracer import Tracer

PEAK = 255.0
FINE_LENS, FINE_FILM = 24, 8
COLUMNS = {
    "camera_array": ("scene", "cameras", "pixels", "seconds", "mrays_per_second", "bytes"),
    "reconstruction": (
        "scene",
        "cameras_per_dim",
        "method",
        "filter_or_samples",
        "rmse",
        "psnr_db",
        "seconds",
    ),
}
DECIMALS = {"seconds": 4, "mrays_per_second": 3, "rmse": 6, "psnr_db": 3}


def errors(image: np.ndarray, reference: np.ndarray) -> dict[str, float]:
    """``rmse`` of linear radiance and ``psnr_db`` of sRGB codes, clipped to [0, 1]."""
    codes = (display_values(part) for part in (image, reference))
    return {"rmse": math.sqrt(mse(image, reference)), "psnr_db": psnr(*codes, peak=PEAK)}


def reconstructions(
    field: DeviceField,
    camera: VirtualCamera,
    focus_z: float,
    reference: np.ndarray,
    *,
    filters: Sequence[float] = (1.0, 2.0),
    samples: Sequence[int] = (4, 16, 64),
    lens_points: Sequence[int] = (8,),
) -> list[dict]:
    """Every method on one array against a reference: rows of the ``reconstruction`` table.

    Parameters
    ----------
    filters : Isaksen's filter, as multiples of the lens radius.  The cone of twice the radius
        spreads about as the disk of the lens does; that of one radius has its support.
    samples : Monte Carlo's rays a pixel (Halton).
    lens_points : a side of the quadrature's lens rule; 2 x 2 points on the film.
    """
    surface, radius = parallel(focus_z), camera.lens_radius_m
    works = [
        ("isaksen", f"{factor * radius:g} m", lambda f=factor: (isaksen, f * radius))
        for factor in filters
    ]
    works += [("monte_carlo", str(count), lambda c=count: (monte_carlo, c)) for count in samples]
    works += [
        ("quadrature", f"{4 * points * points}", lambda p=points: (quadrature, p))
        for points in lens_points
    ]
    rows = []
    for method, label, chosen in works:
        function, value = chosen()
        made, seconds = clocked(lambda f=function, v=value: f(field, camera, surface, v), warm_up=1)
        row = {"cameras_per_dim": field.array.cameras[0], "method": method}
        row |= {"filter_or_samples": label, **errors(made.image, reference), "seconds": seconds}
        rows.append(row)
    return rows


def fine_quadrature(field: DeviceField, camera: VirtualCamera, focus_z: float) -> np.ndarray:
    """The picture of FINE_LENS^2 lens and FINE_FILM^2 film points.

    On the book's array of 16 x 16 cameras it differs from 40^2 lens points by an RMSE of 3e-5; with
    4^2 film points it would differ by 9e-4, as much as Monte Carlo at 256 rays.
    """
    return quadrature(field, camera, parallel(focus_z), FINE_LENS, FINE_FILM).image


def convergence(
    field: DeviceField,
    camera: VirtualCamera,
    focus_z: float,
    counts: Sequence[int],
    *,
    sampler: str,
    limit: np.ndarray | None = None,
) -> dict:
    """Monte Carlo against its limit: ``counts``, ``rmse`` and their log-log ``slope``.

    ``limit`` is the picture that it converges to; default :func:`fine_quadrature`.
    """
    surface = parallel(focus_z)
    if limit is None:
        limit = fine_quadrature(field, camera, focus_z)
    found = [
        math.sqrt(mse(monte_carlo(field, camera, surface, n, sampler=sampler).image, limit))
        for n in counts
    ]
    return {"counts": list(counts), "rmse": found, "slope": slope(counts, found)}


def slope(counts: Sequence[float], values: Sequence[float]) -> float:
    """Exponent p of ``values ~ counts^p``, by least squares on logarithms.

    Raises
    ------
    LfcoreError : fewer than two different counts, or a value that is not positive.
    """
    if len(set(counts)) < 2 or len(counts) != len(values) or min(*counts, *values) <= 0:
        raise LfcoreError(
            "a slope needs positive values at two or more counts",
            key="monte_carlo_samples",
            remedy="Give at least two different numbers of samples",
        )
    return float(np.polyfit(np.log(counts), np.log(values), 1)[0])


def square_field(
    tracer: Tracer,
    cameras: int,
    bounds: Sequence[float],
    fov_deg: float,
    tile: int,
    samples_per_pixel: int,
) -> DeviceField:
    """Trace a square array of square pictures, ready for synthesis.

    A wide array of tiny pictures samples each pixel ``samples_per_pixel`` times, as any other.
    """
    array = CameraArray.on_grid((cameras, cameras), bounds, fov_deg, (tile, tile))
    return DeviceField(tracer.device, trace_array(tracer, array, samples_per_pixel), array)


def array_record(
    scene: str, array: CameraArray, samples_per_pixel: int, seconds: float, size: int
) -> dict:
    """A row of the ``camera_array`` table; ``size`` is in bytes, of its tiled EXR in 16 bits."""
    return {
        "scene": scene,
        "cameras": len(array.columns_m) * len(array.rows_m),
        "pixels": array.tile[0] * array.tile[1],
        "seconds": seconds,
        "mrays_per_second": array.rays * samples_per_pixel / seconds / 1e6,
        "bytes": size,
    }


def exr_bytes(field: DeviceField) -> int:
    """Size of an array's tiled EXR in 16 bits."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "array.exr"
        write_array(file, field.image, field.array, half=True)
        return file.stat().st_size


def overview(image: np.ndarray, width: int) -> np.ndarray:
    """A light field's picture averaged down to at most ``width`` columns, whole blocks only.

    Raises :class:`LfcoreError` for a width below 1.
    """
    if width < 1:
        raise LfcoreError(f"an overview of {width} columns shows nothing", key="picture_px")
    factor = max(1, math.ceil(image.shape[1] / width))
    rows, columns = (length // factor for length in image.shape[:2])
    cut = image[: rows * factor, : columns * factor].astype(np.float32)
    return cut.reshape(rows, factor, columns, factor, 3).mean((1, 3))


def merged_arrays(swept: Iterable[Mapping], whole: Iterable[Mapping]) -> list[Mapping]:
    """Rows of arrays: of a sweep, but for those that are in ``whole``, too; then these."""
    whole = list(whole)
    size = itemgetter("scene", "cameras", "pixels")
    known = {size(row) for row in whole}
    return [*(row for row in swept if size(row) not in known), *whole]


def make_array_table(name: str, records: Iterable[Mapping]) -> pd.DataFrame:
    """The table ``camera_array`` or ``reconstruction``, rows in the order of the records.

    Raises :class:`LfcoreError` for a record that lacks a column or has one too many.
    """
    records = list(records)
    for record in records:
        if set(record) != set(COLUMNS[name]):
            odd = ", ".join(sorted(set(record) ^ set(COLUMNS[name])))
            raise LfcoreError(f"a record of {name} lacks or has too many of: {odd}")
    table = pd.DataFrame(records, columns=list(COLUMNS[name]))
    return table.round({c: d for c, d in DECIMALS.items() if c in table})
