"""Store samples of one scene's light fields in every layout or at every rate."""

from lfcore.evaluation.storage.rate_distortion import layout_rows, rate_rows
from lfcore.evaluation.table_files import write_rows
from lfcore.workflow.batch import open_tracer
from lfcore.workflow.job import job

ROWS = {"storage_layouts": layout_rows, "rate_distortion": rate_rows}

with job(snakemake) as (_, params, output):
    rows_of, tracer = ROWS[params.report], open_tracer(snakemake, spanning=False)
    write_rows(output[0], rows_of(tracer, params.pixels, **params.study))
