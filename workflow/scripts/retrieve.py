"""Decode a stored light field and form the sensor planes from it (Algorithm 4)."""

from lfcore import LightField
from lfcore.files import write_json
from lfcore.opencl.device import open_device
from lfcore.optics.plane_pictures import save_stack, write_plane_pictures
from lfcore.refocus.slicing import form_planes
from lfcore.workflow import cases
from lfcore.workflow.job import job

with job(snakemake) as (inputs, params, output):
    camera, focus_distances_m, _ = cases.read_camera(inputs.scene)
    planes = cases.sensor_planes(params.planes, camera, focus_distances_m)
    name = params.device or None
    field = LightField.open(inputs.light_field)
    formed = form_planes(field, planes, threads=snakemake.threads, device=name)
    pictures = formed.sums.pictures()
    write_plane_pictures(output.pictures, pictures, planes, suffix=params.picture_format)
    save_stack(output.stack, pictures, planes)
    facts = {key: value for key, value in vars(formed).items() if key != "sums"}
    write_json(output.seconds, facts | {"device": open_device(name).name})
