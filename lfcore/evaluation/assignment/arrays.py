"""Camera arrays: a scene's own or a grid, traced, written, and compared with pictures.

Errors are of linear radiance (RMSE) and of sRGB codes (PSNR, the convention of
:mod:`lfcore.evaluation.metrics`).
"""

import math
import tempfile
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from lfcore.colour import display_values
from lfcore.errors import SceneError
from lfcore.evaluation.metrics import PEAK, mse, psnr
from lfcore.opencl.device import Device
from lfcore.optics.array import CameraArray
from lfcore.refocus.array.device_field import DeviceField
from lfcore.rendering.photograph import trace_array
from lfcore.scene.model import Scene
from lfcore.scene.view import LIGHTFIELD
from lfcore.storage.tiled_exr import read_array, write_array
from lfcore.timing import clocked
from lfcore.tracing.tracer import Tracer

DECIMALS = {"seconds": 4, "mrays_per_second": 3, "rmse": 6, "psnr_db": 3}


def array_of(
    scene: Scene, grid: Mapping | None, cameras_per_dim: int, tile_px: int | None
) -> CameraArray:
    """The camera array of a scene: its own ``camera.lightfield``, else the given ``grid``.

    ``grid`` has ``bounds_m`` and ``fov_deg``, and ``cameras_per_dim`` cameras per side; ``tile_px``
    are the pixels per side of each, None for the film's, or 64.  Raises :class:`SceneError` without
    either.
    """
    if scene.view is not None and scene.view.kind == LIGHTFIELD:
        array = scene.view.array
        return array if tile_px is None else replace(array, tile=2 * (tile_px,))
    if grid is not None:
        size = 2 * (tile_px or 64,)
        bounds, fov_deg = grid["bounds_m"], grid["fov_deg"]
        return CameraArray.on_grid(2 * (cameras_per_dim,), bounds, fov_deg, size)
    raise SceneError(
        f"the scene {scene.name!r} has no camera array",
        key="camera.lightfield",
        remedy="Add it to the scene, or the grid to assignment.arrays of the configuration",
    )


def trace_to_exr(tracer: Tracer, array: CameraArray, samples_per_pixel: int, path: Path) -> dict:
    """Trace an array into one tiled EXR; returns its row of the ``camera_array`` table."""
    # Kernels are built per tile size: one camera is traced before the clock starts.
    trace_array(tracer, CameraArray.single(array.fov_deg, array.tile))
    image, seconds = clocked(lambda: trace_array(tracer, array, samples_per_pixel))
    name = tracer.scene.name
    write_array(path, image, array, half=True, extra={"scene": name})
    return array_record(name, array, samples_per_pixel, seconds, path.stat().st_size)


def read_field(device: Device, path: str | Path) -> DeviceField:
    """The array of a tiled EXR that :func:`trace_to_exr` has written, ready for synthesis."""
    stored = read_array(path)
    assert stored.array is not None
    return DeviceField(device, stored.image, stored.array)


def square_field(
    tracer: Tracer, grid: Mapping, cameras: int, tile: int, samples_per_pixel: int
) -> DeviceField:
    """Trace a square array of square pictures; ``grid`` is that of :func:`array_of`."""
    bounds, fov_deg = grid["bounds_m"], grid["fov_deg"]
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


def errors(image: np.ndarray, reference: np.ndarray) -> dict[str, float]:
    """``rmse`` of linear radiance and ``psnr_db`` of sRGB codes, clipped to [0, 1]."""
    codes = (display_values(part) for part in (image, reference))
    return {"rmse": math.sqrt(mse(image, reference)), "psnr_db": psnr(*codes, peak=PEAK)}
