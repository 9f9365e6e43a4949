"""Rate and distortion of one scene, on samples."""

from lfcore.evaluation.storage.rate_distortion import RateStudy, rate_rows
from lfcore.evaluation.table_files import write_rows
from workflow.job import job, log_progress
from workflow.tracer import open_tracer

with job(snakemake):
    params = snakemake.params
    study, progress = RateStudy(**params.study), log_progress("points")
    rows = rate_rows(open_tracer(snakemake), study, params.spatial_resolution, progress=progress)
    write_rows(snakemake.output[0], rows)
