"""The digest of each mesh and texture of a data set."""

from pathlib import Path

from lfcore.files import file_digest, write_json
from lfcore.workflow.job import job

with job(snakemake) as (given, _, output):
    found = {
        key: {Path(file).name: file_digest(file) for file in given[key]} for key in given.keys()
    }
    write_json(output[0], found)
