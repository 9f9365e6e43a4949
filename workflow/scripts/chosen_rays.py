"""The table of the rays that pilots chose, over all scenes."""

from lfcore.evaluation.table_files import read_rows, table_of, write_csv
from lfcore.workflow.chosen_rays import COLUMNS
from lfcore.workflow.job import job

with job(snakemake.log[0], snakemake.threads):
    write_csv(snakemake.output[0], table_of(read_rows(snakemake.input), COLUMNS))
