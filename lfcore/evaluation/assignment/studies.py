"""Studies on camera arrays: seeing through, few and many cameras, a shutter sampled in time.

Each returns sheets of pictures and the measurements.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from lfcore.evaluation.assignment.arrays import array_of, errors, read_field, square_field
from lfcore.evaluation.assignment.book import AUTHORS_FOCUS_M, measured_camera
from lfcore.evaluation.figures import Sheet
from lfcore.opencl.device import Device, programs_made
from lfcore.progress import Progress, silent
from lfcore.refocus.array.device_field import DeviceField
from lfcore.refocus.array.focal_surface import parallel
from lfcore.refocus.array.quadrature import quadrature
from lfcore.refocus.array.result import Synthesis
from lfcore.refocus.array.virtual_camera import VirtualCamera
from lfcore.rendering.photograph import direct_thin_lens
from lfcore.rendering.shutter import trace_shutter
from lfcore.scene.pbrt import build_pbrt_scene
from lfcore.timing import clocked, clocked_warm
from lfcore.tracing.tracer import Tracer

FOV_DEG = 50.0
LENS_POINTS = 24
FEW = (2, 4, 8, 16)
MANY = (4, 8, 16, 32, 64, 128)
SAMPLES = 4
SMALLEST_TILE = 4
SHUTTER_FOCUS_M = 5.4  # the near side of the sphere, from the cameras
SHUTTER_LENS_M = 0.2


def see_through(
    tracer: Tracer,
    *,
    light_field: str | Path,
    study: Mapping,
    picture_px: int,
    reference_samples: int,
    progress: Progress = silent,
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
        """At the middle of the grid, in the array's own direction."""
        return VirtualCamera(np.zeros(3), np.eye(3), FOV_DEG, 2 * (picture_px,), radius)

    def from_field(focus_m: float, radius: float) -> tuple[Synthesis, float]:
        given = field, camera(radius), parallel(focus_m), LENS_POINTS, 2
        return clocked_warm(lambda: quadrature(*given), programs_made)

    direct, direct_seconds = clocked(
        lambda: direct_thin_lens(tracer, camera(lens), focus, reference_samples, progress=progress)
    )
    (pinhole, _), (seen, seconds) = from_field(focus, 0.0), from_field(focus, lens)
    in_front = [from_field(focus_m, radius)[0] for _, focus_m, radius in near]
    pictures = [pinhole.image, seen.image, direct, *(made.image for made in in_front)]
    labels = [
        "light field, pinhole",
        f"light field, focus {focus:g} m",
        f"traced directly, focus {focus:g} m",
        *(f"{name}, focus {focus_m:g} m" for name, focus_m, _ in near),
    ]
    columns = field.array.columns_m
    spacing = columns[1] - columns[0]
    measured = {
        **errors(seen.image, direct),
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
    return [Sheet(pictures, labels, 3)], measured


def sampling(
    tracer: Tracer,
    *,
    grid: Mapping,
    picture_px: int,
    tile_px: int,
    storage_px: int,
    reference_samples: int,
    progress: Progress = silent,
) -> tuple[list[Sheet], dict]:
    """Step 6: few cameras of ``tile_px``; many that share ``storage_px`` pixels per side.

    The picture traced directly, with ``reference_samples`` rays per pixel, is last on each sheet.
    """
    camera = measured_camera(picture_px)
    reference = direct_thin_lens(tracer, camera, AUTHORS_FOCUS_M, reference_samples)
    few = [(cameras, tile_px) for cameras in FEW]
    many = [(cameras, storage_px // cameras) for cameras in MANY]
    of_few, few_rows = _compared(tracer, grid, camera, reference, few)
    progress(1, 2)
    of_many, many_rows = _compared(tracer, grid, camera, reference, many)
    progress(2, 2)
    return [of_few, of_many], {"storage_px": storage_px, "few": few_rows, "many": many_rows}


def _compared(
    tracer: Tracer,
    grid: Mapping,
    camera: VirtualCamera,
    reference: np.ndarray,
    sizes: Sequence[tuple[int, int]],
) -> tuple[Sheet, list[dict]]:
    """Arrays by cameras per side and pixels per camera; tiny pictures are skipped."""
    pictures, labels, records = [], [], []
    for cameras, tile in sizes:
        if tile < SMALLEST_TILE:
            continue
        field = square_field(tracer, cameras, grid["bounds_m"], grid["fov_deg"], tile, SAMPLES)
        made = quadrature(field, camera, parallel(AUTHORS_FOCUS_M), LENS_POINTS, 2).image
        found = errors(made, reference)
        pictures.append(made)
        labels.append(f"{cameras} x {cameras} of {tile} x {tile}: {found['psnr_db']:.1f} dB")
        records.append({"cameras_per_dim": cameras, "tile_px": tile, **found})
    columns = len(pictures) // 2 + 1
    return Sheet([*pictures, reference], [*labels, "traced directly"], columns), records


def time(
    device: Device,
    *,
    files: Sequence[str | Path],
    picture_px: int,
    instants: int,
    progress: Progress = silent,
) -> tuple[list[Sheet], dict]:
    """Step 6: an open shutter before moving objects, sampled at more and more instants.

    Errors are against the most instants.  ``files`` are those of a pbrt scene with a camera array,
    its own first; ``progress`` is called with (instants done, of all).
    """
    scene = build_pbrt_scene(files[0])
    array = array_of(scene, None, 0, None)
    size = (picture_px, picture_px)
    camera = VirtualCamera(np.zeros(3), np.eye(3), 40.0, size, SHUTTER_LENS_M)
    counts = [1, *(n for n in (2, 4, 8, 16, 32, 64) if n < instants), instants]
    pictures, seconds = [], []
    for count in counts:
        tracing = partial(trace_shutter, scene, array, count, device=device, progress=progress)
        image, taken = clocked(tracing)
        seconds.append(taken)
        field = DeviceField(device, image, array)
        pictures.append(quadrature(field, camera, parallel(SHUTTER_FOCUS_M), 16, 2).image)
    found = [errors(picture, pictures[-1]) for picture in pictures[:-1]]
    labels = [
        f"{count} instant{'s' * (count > 1)}: {error['psnr_db']:.1f} dB"
        for count, error in zip(counts, found, strict=False)
    ]
    labels.append(f"{counts[-1]} instants")
    record = {"counts": counts, "seconds": seconds, "rmse": [error["rmse"] for error in found]}
    return [Sheet(pictures, labels, 3)], record
