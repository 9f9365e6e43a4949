"""Columns of one of the thesis's tables over N, ours and the thesis's."""

import pandas as pd

from lfcore.evaluation.figures import PANELS, curves_over_n, save_figure
from lfcore.workflow.job import job

with job(snakemake.log[0], snakemake.threads):
    table = pd.read_csv(snakemake.input[0])
    save_figure(snakemake.output[0], curves_over_n(table, PANELS[snakemake.wildcards.table]))
