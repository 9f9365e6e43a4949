"""Step 6: an open shutter before a rolling sphere, sampled at more and more instants."""

import time

import numpy as np

from lfcore.evaluation.camera_arrays import errors
from lfcore.evaluation.figures import contact_sheet
from lfcore.files import write_json
from lfcore.opencl.device import open_device
from lfcore.refocus.array.device_field import DeviceField
from lfcore.refocus.array.focal_surface import parallel
from lfcore.refocus.array.quadrature import quadrature
from lfcore.refocus.array.virtual_camera import VirtualCamera
from lfcore.rendering.shutter import trace_shutter
from lfcore.scene.pbrt import build_pbrt_scene
from workflow.job import job, log_progress

FOCUS_M = 5.4  # the near side of the sphere, from the cameras
LENS_M = 0.2

with job(snakemake):
    params = snakemake.params
    scene = build_pbrt_scene(snakemake.input.scene)
    print(scene.summary())
    device = open_device(params.device or None, threads=snakemake.threads)
    size = (params.picture_px, params.picture_px)
    camera = VirtualCamera(np.zeros(3), np.eye(3), 40.0, size, LENS_M)
    counts = [1, *(n for n in (2, 4, 8, 16, 32, 64) if n < params.instants), params.instants]
    pictures, seconds = [], []
    for count in counts:
        begun = time.perf_counter()
        image = trace_shutter(
            scene, scene.view.array, count, device=device, progress=log_progress("instants")
        )
        seconds.append(time.perf_counter() - begun)
        field = DeviceField(device, image, scene.view.array)
        pictures.append(quadrature(field, camera, parallel(FOCUS_M), 16, 2).image)
    found = [errors(picture, pictures[-1]) for picture in pictures[:-1]]
    labels = [
        f"{count} instant{'s' * (count > 1)}: {error['psnr_db']:.1f} dB"
        for count, error in zip(counts, found, strict=False)
    ]
    labels.append(f"{counts[-1]} instants")
    contact_sheet(snakemake.output.figure, pictures, labels, panel_px=300, columns=3)
    record = {"counts": counts, "seconds": seconds, "rmse": [error["rmse"] for error in found]}
    write_json(snakemake.output.record, record)
    print(record)
