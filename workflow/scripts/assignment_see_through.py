"""Ecosys: the hillside through the trees, from the light field and directly; then each tree."""

import time

import numpy as np

from lfcore.evaluation.camera_arrays import errors, timed
from lfcore.evaluation.figures import contact_sheet
from lfcore.files import write_json
from lfcore.refocus.array.device_field import DeviceField
from lfcore.refocus.array.focal_surface import parallel
from lfcore.refocus.array.quadrature import quadrature
from lfcore.refocus.array.virtual_camera import VirtualCamera
from lfcore.rendering.photograph import direct_thin_lens
from lfcore.storage.tiled_exr import read_array
from workflow.assignment import ECOSYS_FOCUS_M
from workflow.job import job, log_progress
from workflow.tracer import open_tracer

FOV_DEG = 50.0
LENS_POINTS = 24
# Wide for the hillside; for the trees narrow, so that more than their middle is sharp.
LENS_M = {"hillside": 1.4, "first tree": 0.4, "second tree": 0.6}


def camera(name, size, radius=None):
    """At the middle of the grid, turned to nothing: the array's own direction."""
    radius = LENS_M[name] if radius is None else radius
    return VirtualCamera(np.zeros(3), np.eye(3), FOV_DEG, (size, size), radius)


def from_field(field, name, size, radius=None):
    surface = parallel(ECOSYS_FOCUS_M[name])
    return timed(lambda: quadrature(field, camera(name, size, radius), surface, LENS_POINTS, 2))


with job(snakemake):
    params, size = snakemake.params, snakemake.params.picture_px
    found = read_array(snakemake.input.light_field)
    tracer = open_tracer(snakemake)
    field = DeviceField(tracer.device, found.image, found.array)
    hill, focus = "hillside", ECOSYS_FOCUS_M["hillside"]
    begun = time.perf_counter()
    direct = direct_thin_lens(
        tracer,
        camera(hill, size),
        focus,
        params.reference_samples,
        progress=log_progress("samples"),
    )
    direct_seconds = time.perf_counter() - begun
    pinhole, _ = from_field(field, hill, size, 0.0)
    seen, seconds = from_field(field, hill, size)
    trees = [from_field(field, name, size)[0] for name in ("first tree", "second tree")]
    pictures = [pinhole.image, seen.image, direct, *(tree.image for tree in trees)]
    labels = [
        "light field, pinhole",
        f"light field, focus {focus:g} m",
        f"traced directly, focus {focus:g} m",
        *(f"{name}, focus {ECOSYS_FOCUS_M[name]:g} m" for name in ("first tree", "second tree")),
    ]
    contact_sheet(snakemake.output.figure, pictures, labels, panel_px=300, columns=3)
    spacing = found.array.columns_m[1] - found.array.columns_m[0]
    record = {
        **errors(seen.image, direct),
        "pinhole_psnr_db": errors(pinhole.image, direct)["psnr_db"],
        "seconds": seconds,
        "direct_seconds": direct_seconds,
        "direct_samples": params.reference_samples,
        "lens_m": LENS_M,
        "spacing_m": spacing,
        # Where neighbouring cameras see the first tree, aimed at the hill, in their own pixels.
        "jump_px": spacing
        * abs(1 / ECOSYS_FOCUS_M["first tree"] - 1 / focus)
        / found.array.pixel_pitch,
    }
    write_json(snakemake.output.record, record)
    print(record)
