"""The thesis's tables over all scenes."""

from lfcore.evaluation.table_files import write_csv
from lfcore.evaluation.tables import make_table, read_records
from lfcore.files import read_json
from lfcore.workflow.job import job

with job(snakemake.log[0], snakemake.threads):
    scenes = [read_json(path) for path in snakemake.input]
    for name, file in zip(snakemake.params.tables, snakemake.output, strict=True):
        write_csv(file, make_table(name, read_records(scenes, name)))
