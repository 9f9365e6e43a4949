"""Every layout of one scene's light fields, on samples."""

from lfcore.evaluation.storage.layouts import LayoutStudy, layout_rows
from lfcore.evaluation.table_files import write_rows
from lfcore.workflow.job import job, log_progress
from lfcore.workflow.tracers import open_tracer

with job(snakemake.log[0], snakemake.threads):
    params = snakemake.params
    study, progress = LayoutStudy(**params.study), log_progress("layouts")
    tracer = open_tracer(snakemake.input, params.device, snakemake.threads)
    rows = layout_rows(tracer, study, params.spatial_resolution, progress=progress)
    write_rows(snakemake.output[0], rows)
