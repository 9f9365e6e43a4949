"""A table over the rows of all scenes, and its figure where it has one."""

import pandas as pd

from lfcore.evaluation import equivalence
from lfcore.evaluation.left_out import comparisons
from lfcore.evaluation.storage import layouts, retrieval
from lfcore.evaluation.storage.figures import layouts_figure, retrieval_figure
from lfcore.evaluation.table_files import read_rows, table_of, write_csv
from lfcore.workflow.job import job

COLUMNS = {
    "storage_layouts": layouts.COLUMNS,
    "equivalence": equivalence.COLUMNS,
    "retrieval": retrieval.COLUMNS,
    "left_out": comparisons.COLUMNS,
}
FIGURES = {"storage_layouts": layouts_figure, "retrieval": retrieval_figure}

with job(snakemake.log[0], snakemake.threads):
    output, name = snakemake.output, snakemake.params.table
    write_csv(output.csv, table_of(read_rows(snakemake.input), COLUMNS[name]))
    if "figure" in output.keys():
        FIGURES[name](output.figure, pd.read_csv(output.csv))
