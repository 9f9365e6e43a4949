"""Columns of the thesis's tables over N, ours and the thesis's."""

import pandas as pd

from lfcore.evaluation.figures import PANELS, curves_over_n, save_figure
from lfcore.workflow.job import job

with job(snakemake.log[0], snakemake.threads):
    given, output, tables = snakemake.input, snakemake.output, snakemake.params.tables
    for name, table, figure in zip(tables, given, output, strict=True):
        save_figure(figure, curves_over_n(pd.read_csv(table), PANELS[name]))
