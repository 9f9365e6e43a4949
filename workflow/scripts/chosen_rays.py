"""The table of chosen rays over all scenes."""

from lfcore.evaluation.chosen_rays import chosen_rays_table
from lfcore.evaluation.table_files import read_rows, write_csv
from lfcore.workflow.job import job

with job(snakemake.log[0], snakemake.threads):
    write_csv(snakemake.output.csv, chosen_rays_table(read_rows(snakemake.input.rows)))
