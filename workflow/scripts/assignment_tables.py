"""The tables of camera arrays and of pictures from them."""

from lfcore.evaluation.assignment.arrays import make_array_table, merged_arrays
from lfcore.evaluation.table_files import write_csv
from lfcore.files import read_json
from lfcore.workflow.job import job

with job(snakemake.log[0], snakemake.threads):
    given, output = snakemake.input, snakemake.output
    measured = read_json(given.reconstruction)
    whole = [read_json(file) for file in given.camera_array]
    arrays = merged_arrays(measured["arrays"], whole)
    write_csv(output.camera_array, make_array_table("camera_array", arrays))
    write_csv(output.reconstruction, make_array_table("reconstruction", measured["rows"]))
