"""What we would do, beside the thesis's largest N, over all scenes."""

from lfcore.evaluation.table_files import read_rows, write_csv
from lfcore.evaluation.true_picture.choice import compared
from lfcore.workflow.job import job

with job(snakemake.log[0], snakemake.threads):
    write_csv(snakemake.output.csv, compared(read_rows(snakemake.input)))
