"""The page in which one light field is looked at."""

from lfcore.lightfield import LightField
from lfcore.opencl.device import open_device
from lfcore.workflow.job import job

with job(snakemake) as (given, params, output):
    device = open_device(params.device or None, threads=snakemake.threads)
    with LightField.open(given.light_field) as field:
        field.viewer(device=device).save(output[0])
