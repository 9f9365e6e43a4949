"""The tables of camera arrays and of pictures from them."""

from lfcore.evaluation.assignment.arrays import DECIMALS, merged_arrays
from lfcore.evaluation.table_files import table_of, write_csv
from lfcore.files import read_json
from lfcore.workflow.job import job

with job(snakemake) as (given, _, output):
    measured = read_json(given.reconstruction)
    whole = [read_json(file) for file in given.camera_array]
    arrays = merged_arrays(measured["arrays"], whole)
    write_csv(output.camera_array, table_of(arrays, decimals=DECIMALS))
    write_csv(output.reconstruction, table_of(measured["rows"], decimals=DECIMALS))
