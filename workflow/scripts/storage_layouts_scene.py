"""Every layout of one scene's light fields, on samples."""

from lfcore.evaluation.storage.layouts import LayoutStudy, layout_rows
from lfcore.evaluation.table_files import write_rows
from workflow.job import job, log_progress
from workflow.tracer import open_tracer

with job(snakemake):
    params = snakemake.params
    study, progress = LayoutStudy(**params.study), log_progress("layouts")
    rows = layout_rows(open_tracer(snakemake), study, params.spatial_resolution, progress=progress)
    write_rows(snakemake.output[0], rows)
