"""What it costs to read the stored light fields of one scene."""

from lfcore.evaluation.storage.retrieval import retrieval_rows
from lfcore.evaluation.table_files import write_rows
from lfcore.opencl.device import open_device
from lfcore.workflow import cases
from lfcore.workflow.job import job, log_progress

with job(snakemake.log[0], snakemake.threads):
    params = snakemake.params
    _, focus_distances_m, _ = cases.read_camera(snakemake.input.scene)
    device = open_device(params.device or None, threads=snakemake.threads)
    rows = []
    for file in snakemake.input.light_fields:
        rows += retrieval_rows(
            file,
            snakemake.wildcards.scene,
            (min(focus_distances_m), max(focus_distances_m)),
            device,
            **params.study,
            progress=log_progress(file),
        )
    write_rows(snakemake.output[0], rows)
