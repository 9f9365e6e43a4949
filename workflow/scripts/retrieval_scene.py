"""Measure the cost of reading the stored light fields of one scene."""

from lfcore.evaluation.storage.retrieval import retrieval_rows
from lfcore.evaluation.table_files import write_rows
from lfcore.opencl.device import open_device
from lfcore.workflow import cases
from lfcore.workflow.job import job

with job(snakemake) as (inputs, params, output):
    _, focus_distances_m, _ = cases.read_camera(inputs.scene)
    device = open_device(params.device or None, threads=snakemake.threads)
    rows = []
    for file in inputs.light_fields:
        rows += retrieval_rows(
            file,
            snakemake.wildcards.scene,
            (min(focus_distances_m), max(focus_distances_m)),
            device,
            **params.study,
        )
    write_rows(output[0], rows)
