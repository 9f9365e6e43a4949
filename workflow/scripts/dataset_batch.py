"""Make the items of one job: a shard, and a record of each."""

from pathlib import Path

from lfcore.datasets.description import Description
from lfcore.datasets.items import make_batch
from lfcore.datasets.stored import Finished
from lfcore.opencl.device import open_device
from lfcore.workflow.job import job

with job(snakemake) as (inputs, params, output):
    description = Description.check(params.description)
    folder = Path(output.shard).parent.parent
    sources = Path(inputs[0]).read_text(encoding="utf-8")
    made_of = f"{description.digest(sources)}-{params.version}"
    make_batch(
        description,
        range(*params.scenes),
        output.shard,
        output.records,
        folder / f"drafts-{made_of}-{snakemake.wildcards.batch}",
        open_device(params.device or None, threads=snakemake.threads),
        made_of=made_of,
        finished=Finished.at(folder),
    )
