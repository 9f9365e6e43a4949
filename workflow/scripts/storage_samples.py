"""Samples of one scene's light fields, stored in every layout or at every rate."""

from lfcore.evaluation.storage.rate_distortion import layout_rows, rate_rows
from lfcore.evaluation.table_files import write_rows
from lfcore.workflow.batch import open_tracer
from lfcore.workflow.job import job, log_progress

ROWS = {"storage_layouts": layout_rows, "rate_distortion": rate_rows}

with job(snakemake) as (_, params, output):
    rows_of, progress = ROWS[params.report], log_progress("samples")
    tracer = open_tracer(snakemake)
    rows = rows_of(tracer, params.pixels, **params.study, progress=progress)
    write_rows(output[0], rows)
