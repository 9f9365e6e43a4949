"""The page in which one light field is looked at."""

from lfcore.lightfield import LightField
from lfcore.opencl.device import open_device
from lfcore.workflow.job import job

with job(snakemake.log[0], snakemake.threads):
    device = open_device(snakemake.params.device or None, threads=snakemake.threads)
    with LightField.open(snakemake.input.light_field) as field:
        field.viewer(device=device).save(snakemake.output[0])
