"""Write the digest of each mesh and texture of a data set."""

from pathlib import Path

from lfcore.files import file_digest, write_json
from lfcore.workflow.job import job

with job(snakemake) as (inputs, _, output):
    digests = {
        key: {Path(file).name: file_digest(file) for file in inputs[key]} for key in inputs.keys()
    }
    write_json(output[0], digests)
