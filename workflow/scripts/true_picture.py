"""The table and figure of true errors over all scenes."""

import pandas as pd

from lfcore.evaluation.table_files import write_csv
from lfcore.evaluation.true_picture.figure import true_errors
from lfcore.evaluation.true_picture.points import COLUMNS, rounded
from lfcore.files import read_json
from lfcore.workflow.job import job

with job(snakemake.log[0], snakemake.threads):
    scenes = [read_json(path) for path in snakemake.input]
    rows = pd.DataFrame([row for one in scenes for row in one["rows"]], columns=list(COLUMNS))
    machine = f"{scenes[0]['device']}, {scenes[0]['threads']} thread"
    true_errors(snakemake.output.figure, rows, machine=machine)
    write_csv(snakemake.output.csv, rounded(rows))
