"""Step 6: arrays of few cameras, many cameras of few pixels, and a shutter sampled in time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np

from lfcore.evaluation.assignment.book import AUTHORS_FOCUS_M, measured_camera
from lfcore.evaluation.camera_arrays import errors, square_field
from lfcore.evaluation.timing import clocked
from lfcore.opencl.device import Device
from lfcore.refocus.array.device_field import DeviceField
from lfcore.refocus.array.focal_surface import parallel
from lfcore.refocus.array.quadrature import quadrature
from lfcore.refocus.array.virtual_camera import VirtualCamera
from lfcore.rendering.photograph import direct_thin_lens
from lfcore.rendering.shutter import trace_shutter
from lfcore.scene.model import Scene
from lfcore.tracing.tracer import Tracer

FEW = (2, 4, 8, 16)
MANY = (4, 8, 16, 32, 64, 128)
SAMPLES = 4
SMALLEST_TILE = 4
SHUTTER_FOCUS_M = 5.4  # the near side of the sphere, from the cameras
SHUTTER_LENS_M = 0.2

Study = tuple[list[np.ndarray], list[str], list[dict]]


def compare_arrays(
    tracer: Tracer,
    grid: Mapping,
    picture_px: int,
    tile_px: int,
    storage_px: int,
    samples: int,
) -> tuple[Study, Study]:
    """Few cameras of ``tile_px``; many that share a picture of ``storage_px`` a side.

    Each is pictures, labels and measurements, the picture traced directly last among the pictures.

    Parameters
    ----------
    grid : ``bounds_m`` and ``fov_deg`` of the cameras.
    samples : rays a pixel of the picture that is traced directly.
    """
    camera = measured_camera(picture_px)
    reference = direct_thin_lens(tracer, camera, AUTHORS_FOCUS_M, samples)
    few = [(cameras, tile_px) for cameras in FEW]
    many = [(cameras, storage_px // cameras) for cameras in MANY]
    many = [(cameras, tile) for cameras, tile in many if tile >= SMALLEST_TILE]
    return tuple(_compared(tracer, grid, camera, reference, sizes) for sizes in (few, many))


def _compared(tracer, grid, camera, reference, sizes: Iterable[tuple[int, int]]) -> Study:
    pictures, labels, records = [], [], []
    for cameras, tile in sizes:
        field = square_field(tracer, cameras, grid["bounds_m"], grid["fov_deg"], tile, SAMPLES)
        made = quadrature(field, camera, parallel(AUTHORS_FOCUS_M), 24, 2).image
        found = errors(made, reference)
        pictures.append(made)
        labels.append(f"{cameras} x {cameras} of {tile} x {tile}: {found['psnr_db']:.1f} dB")
        records.append({"cameras_per_dim": cameras, "tile_px": tile, **found})
    return [*pictures, reference], [*labels, "traced directly"], records


def shutter(
    scene: Scene,
    device: Device,
    picture_px: int,
    instants: int,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[list[np.ndarray], list[str], dict]:
    """An open shutter before what moves, sampled at more and more instants.

    Returns pictures, labels, and errors against the most instants.
    """
    size = (picture_px, picture_px)
    camera = VirtualCamera(np.zeros(3), np.eye(3), 40.0, size, SHUTTER_LENS_M)
    counts = [1, *(n for n in (2, 4, 8, 16, 32, 64) if n < instants), instants]
    pictures, seconds = [], []
    for count in counts:
        image, taken = clocked(
            lambda count=count: trace_shutter(
                scene, scene.view.array, count, device=device, progress=progress
            )
        )
        seconds.append(taken)
        field = DeviceField(device, image, scene.view.array)
        pictures.append(quadrature(field, camera, parallel(SHUTTER_FOCUS_M), 16, 2).image)
    found = [errors(picture, pictures[-1]) for picture in pictures[:-1]]
    labels = [
        f"{count} instant{'s' * (count > 1)}: {error['psnr_db']:.1f} dB"
        for count, error in zip(counts, found, strict=False)
    ]
    labels.append(f"{counts[-1]} instants")
    record = {"counts": counts, "seconds": seconds, "rmse": [error["rmse"] for error in found]}
    return pictures, labels, record
