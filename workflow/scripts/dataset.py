"""Write a data set from its shards: the folder of items, tables, card and page."""

from pathlib import Path

from lfcore.datasets.description import Description
from lfcore.datasets.making import write_set
from lfcore.workflow.job import job

with job(snakemake) as (inputs, params, output):
    place = f"{params.folder}/description.yaml"
    command = f"snakemake --cores 2 {params.folder}/ --configfile {place}"
    batches = Path(inputs.shards[0]).parent
    write_set(Description.check(params.description), batches, Path(output[0]), command)
