"""A scene photographed by a grid of cameras, and the grid that it is photographed by."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from lfcore.errors import SceneError
from lfcore.evaluation.camera_arrays import array_record
from lfcore.evaluation.timing import clocked
from lfcore.optics.array import CameraArray
from lfcore.rendering.array import trace_array
from lfcore.scene.model import Scene
from lfcore.scene.view import LIGHTFIELD
from lfcore.storage.tiled_exr import write_array
from lfcore.tracing.tracer import Tracer


def array_of(
    scene: Scene, grid: Mapping | None, cameras_per_dim: int, tile_px: int | None
) -> CameraArray:
    """The camera array of a scene: its own ``camera.lightfield``, else the ``grid`` that is given.

    Parameters
    ----------
    grid : ``bounds_m`` and ``fov_deg`` for a scene without an array of its own.
    cameras_per_dim : data cameras a side of such a grid.
    tile_px : pixels a side of each; None is the film's, or 64.

    Raises
    ------
    SceneError : the scene has no array, and no grid was given.
    """
    own = scene.view is not None and scene.view.kind == LIGHTFIELD
    if grid is not None and not own:
        size = 2 * (tile_px or 64,)
        bounds, fov_deg = grid["bounds_m"], grid["fov_deg"]
        return CameraArray.on_grid(2 * (cameras_per_dim,), bounds, fov_deg, size)
    if not own:
        raise SceneError(
            f"the scene {scene.name!r} has no camera array",
            key="camera.lightfield",
            remedy="Add it to the scene, or the grid to assignment.arrays of the configuration",
        )
    array = scene.view.array
    return array if tile_px is None else replace(array, tile=2 * (tile_px,))


def trace_to_exr(
    tracer: Tracer,
    array: CameraArray,
    samples_per_pixel: int,
    path: Path,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> dict:
    """Trace an array into one tiled EXR; returns its row of the ``camera_array`` table."""
    # Kernels are built for the size of a tile: one camera of it, unseen by the clock.
    trace_array(tracer, CameraArray.single(array.fov_deg, array.tile))
    image, seconds = clocked(
        lambda: trace_array(tracer, array, samples_per_pixel, progress=progress)
    )
    name = tracer.scene.name
    write_array(path, image, array, half=True, extra={"scene": name})
    return array_record(name, array, samples_per_pixel, seconds, path.stat().st_size)
