"""Write all cases of a sweep as one table and one figure."""

from lfcore.evaluation.figures import save_figure
from lfcore.evaluation.sweep import sweep_figure
from lfcore.evaluation.table_files import read_rows, write_csv
from lfcore.workflow.job import job
from lfcore.workflow.sweep import joined

with job(snakemake) as (inputs, params, output):
    table = joined(params.overrides, read_rows(inputs))
    write_csv(output.csv, table)
    save_figure(output.figure, sweep_figure(table))
