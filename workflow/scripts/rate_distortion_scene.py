"""Rate and distortion of one scene, on samples."""

from lfcore.evaluation.storage.rate_distortion import RateStudy, rate_rows
from lfcore.evaluation.table_files import write_rows
from lfcore.workflow.job import job, log_progress
from lfcore.workflow.tracers import open_tracer

with job(snakemake.log[0], snakemake.threads):
    params = snakemake.params
    study, progress = RateStudy(**params.study), log_progress("points")
    tracer = open_tracer(snakemake.input, params.device, snakemake.threads)
    rows = rate_rows(tracer, study, params.spatial_resolution, progress=progress)
    write_rows(snakemake.output[0], rows)
