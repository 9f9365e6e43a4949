"""The cheapest setting for a quality, from the points of the work-precision diagrams."""

import pandas as pd

from lfcore.evaluation.recommendation import recommendation
from lfcore.evaluation.table_files import write_csv
from lfcore.workflow.job import job

with job(snakemake.log[0], snakemake.threads):
    points = pd.read_csv(snakemake.input[0])
    write_csv(snakemake.output[0], recommendation(points, snakemake.params.targets_db))
