"""The cheapest setting for a quality, from the points of the work-precision diagrams."""

import pandas as pd

from lfcore.evaluation.recommendation import recommendation
from lfcore.evaluation.table_files import publish_table
from workflow.job import job

with job(snakemake):
    given, output = snakemake.input, snakemake.output
    table = recommendation(pd.read_csv(given.points), snakemake.params.targets_db)
    publish_table(
        table,
        output.csv,
        output.markdown,
        title="Recommended settings",
        caption=given.caption,
        config=snakemake.params.config,
    )
