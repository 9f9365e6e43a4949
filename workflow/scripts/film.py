"""Join the groups of a film's instants."""

from pathlib import Path

from lfcore.files import read_json
from lfcore.opencl.device import open_device
from lfcore.rendering.record_film import Ahead
from lfcore.workflow.films import film_of
from lfcore.workflow.job import job

with job(snakemake) as (inputs, params, output):
    device = open_device(params.device or None, threads=snakemake.threads)
    ahead = Ahead.from_json(read_json(inputs.ahead))
    film, content = film_of(params, inputs.scene, inputs.light, device, ahead)
    film.join(output[0], [Path(folder) for folder in inputs.segments], content)
