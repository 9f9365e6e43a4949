"""The figure of one of the store's tables."""

import pandas as pd

from lfcore.evaluation.storage.figures import layouts_figure, retrieval_figure
from lfcore.workflow.job import job

FIGURES = {"storage_layouts": layouts_figure, "retrieval": retrieval_figure}

with job(snakemake.log[0], snakemake.threads):
    draw = FIGURES[snakemake.params.table]
    draw(snakemake.output[0], pd.read_csv(snakemake.input[0]))
