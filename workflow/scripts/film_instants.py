"""Trace and encode a group of a film's instants."""

from pathlib import Path

from lfcore.files import make_folder, read_json
from lfcore.opencl.device import open_device
from lfcore.rendering.record_film import Ahead
from lfcore.workflow.films import film_of
from lfcore.workflow.job import job

with job(snakemake) as (inputs, params, output):
    device = open_device(params.device or None, threads=snakemake.threads)
    ahead = Ahead.from_json(read_json(inputs.ahead))
    film, _ = film_of(params, inputs.scene, inputs.light, device, ahead)
    make_folder(Path(output[0]))
    film.trace([int(snakemake.wildcards.group)], Path(output[0]), device)
