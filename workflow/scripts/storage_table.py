"""A table over the rows of all scenes."""

from lfcore.evaluation import equivalence
from lfcore.evaluation.left_out import comparisons
from lfcore.evaluation.storage import layouts, retrieval
from lfcore.evaluation.table_files import read_rows, table_of, write_csv
from lfcore.workflow.job import job

COLUMNS = {
    "storage_layouts": layouts.COLUMNS,
    "equivalence": equivalence.COLUMNS,
    "retrieval": retrieval.COLUMNS,
    "left_out": comparisons.COLUMNS,
}

with job(snakemake.log[0], snakemake.threads):
    columns = COLUMNS[snakemake.params.table]
    write_csv(snakemake.output[0], table_of(read_rows(snakemake.input), columns))
