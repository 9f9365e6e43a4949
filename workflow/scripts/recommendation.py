"""The cheapest setting for a quality, from the points of the work-precision diagrams."""

from pathlib import Path

import pandas as pd

from lfcore.evaluation.captions import fill
from lfcore.evaluation.recommendation import recommendation
from lfcore.evaluation.tables import write_csv, write_markdown
from workflow.job import job

with job(snakemake):
    given, output = snakemake.input, snakemake.output
    table = recommendation(pd.read_csv(given.points), snakemake.params.targets_db)
    write_csv(output.csv, table)
    text = fill(Path(given.caption).read_text(encoding="utf-8"), snakemake.params.config)
    write_markdown(output.markdown, table, title="Recommended settings", caption=text)
