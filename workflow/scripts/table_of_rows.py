"""Write a table of all scenes' rows, and its figure, if any."""

import pandas as pd

from lfcore.evaluation.chosen_rays import chosen_rays_table
from lfcore.evaluation.storage.figures import layouts_figure, retrieval_figure
from lfcore.evaluation.table_files import read_rows, table_of, write_csv
from lfcore.workflow.job import job

TABLES = {"chosen_rays": chosen_rays_table}
FIGURES = {"storage_layouts": layouts_figure, "retrieval": retrieval_figure}

with job(snakemake) as (inputs, params, output):
    write_csv(output.csv, TABLES.get(params.table, table_of)(read_rows(inputs.rows)))
    for file in output.figures:
        FIGURES[params.table](file, pd.read_csv(output.csv))
