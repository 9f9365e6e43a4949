"""Trace a few rays of each instant of a film: ranges of depth, and the brightest light."""

from lfcore.files import write_json
from lfcore.opencl.device import open_device
from lfcore.workflow.films import film_of
from lfcore.workflow.job import job

with job(snakemake) as (inputs, params, output):
    device = open_device(params.device or None, threads=snakemake.threads)
    film, _ = film_of(params, inputs.scene, inputs.light, device)
    write_json(output[0], film.ahead.to_json())
