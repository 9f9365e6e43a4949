"""Make the scenes of one job: a shard, and what is known of each."""

from pathlib import Path

from lfcore.datasets.description import Description
from lfcore.datasets.items import make_batch
from lfcore.opencl.device import open_device
from lfcore.workflow.job import job

with job(snakemake) as (_, params, output):
    description = Description.check(params.description)
    drafts = f"drafts-{description.digest()}-{params.version}-{snakemake.wildcards.batch}"
    make_batch(
        description,
        range(*params.scenes),
        output.shard,
        output.records,
        Path(output.shard).parent.parent / drafts,
        open_device(params.device or None, threads=snakemake.threads),
    )
