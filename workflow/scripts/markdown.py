"""A table as Markdown, with its caption."""

import pandas as pd

from lfcore.evaluation.table_files import write_markdown
from lfcore.workflow.job import job

with job(snakemake.log[0], snakemake.threads):
    params, table = snakemake.params, pd.read_csv(snakemake.input.table)
    write_markdown(snakemake.output[0], table, title=params.title, caption=params.caption)
