"""Make the items of one job: a shard, and a record of each."""

from pathlib import Path

from lfcore.datasets.batches import run_batch
from lfcore.datasets.description import Description
from lfcore.workflow.job import job

with job(snakemake) as (inputs, params, output):
    shard, sources = Path(output.shard), Path(inputs[0]).read_text(encoding="utf-8")
    run_batch(
        Description.check(params.description),
        range(*params.scenes),
        shard,
        shard.parent.parent,
        sources,
        params.device or None,
        snakemake.threads,
    )
