"""A table of the rows of all scenes, and its figure where it has one."""

import pandas as pd

from lfcore.evaluation.storage.figures import layouts_figure, retrieval_figure
from lfcore.evaluation.table_files import read_rows, table_of, write_csv
from lfcore.workflow.job import job

FIGURES = {"storage_layouts": layouts_figure, "retrieval": retrieval_figure}

with job(snakemake.log[0], snakemake.threads):
    output, rows = snakemake.output, read_rows(snakemake.input)
    write_csv(output.csv, table_of(rows, list(rows[0])))
    for file in output.figures:
        FIGURES[snakemake.params.table](file, pd.read_csv(output.csv))
