"""Decode a stored light field and form the sensor planes from it (Algorithm 4)."""

from lfcore.files import write_json
from lfcore.opencl.device import open_device
from lfcore.optics.plane_pictures import save_stack, write_plane_pictures
from lfcore.refocus.slicing import form_planes
from lfcore.workflow import cases
from lfcore.workflow.job import job, log_progress

with job(snakemake) as (given, params, output):
    camera, focus_distances_m, _ = cases.read_camera(given.scene)
    planes = cases.sensor_planes(params.planes, camera, focus_distances_m)
    device = open_device(params.device or None, threads=snakemake.threads)
    retrieval = form_planes(
        given.light_field,
        planes,
        threads=snakemake.threads,
        device=params.device or None,
        progress=log_progress("frames"),
    )
    pictures = retrieval.sums.pictures()
    write_plane_pictures(output.pictures, pictures, planes, suffix=params.picture_format)
    save_stack(output.stack, pictures, planes)
    write_json(
        output.seconds,
        {
            "seconds": retrieval.seconds,
            "decode_seconds": retrieval.decode_seconds,
            "plane_seconds": retrieval.plane_seconds,
            "threads": retrieval.threads,
            "device": device.name,
        },
    )
