"""Write the viewer's page of one light field."""

from lfcore.lightfield import LightField
from lfcore.opencl.device import open_device
from lfcore.workflow.job import job

with job(snakemake) as (inputs, params, output):
    device = open_device(params.device or None, threads=snakemake.threads)
    with LightField.open(inputs.light_field) as field:
        field.viewer(device=device).save(output[0])
