"""Write the digest of each mesh and texture of a data set."""

from lfcore.datasets.description import Description
from lfcore.files import write_text
from lfcore.workflow.job import job

with job(snakemake) as (_, params, output):
    write_text(output[0], Description.check(params.description).sources())
