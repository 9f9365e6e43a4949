"""Write the thesis's tables over all scenes, and curves over N, ours and the thesis's."""

from lfcore.evaluation.figures import PANELS, curves_over_n, save_figure
from lfcore.evaluation.table_files import read_rows, write_csv
from lfcore.evaluation.tables import make_table
from lfcore.workflow.job import job

with job(snakemake) as (inputs, params, output):
    records = read_rows(inputs)
    tables = {name: make_table(name, records) for name in params.tables}
    for table, file in zip(tables.values(), output.csv, strict=True):
        write_csv(file, table)
    for name, file in zip(tables, output.curves, strict=False):  # no curves, or one per table
        save_figure(file, curves_over_n(tables[name], PANELS[name]))
