"""Write the tables of camera arrays and of pictures from them."""

import pandas as pd

from lfcore.evaluation.assignment.arrays import DECIMALS
from lfcore.evaluation.table_files import table_of, write_csv
from lfcore.files import read_json
from lfcore.workflow.job import job

with job(snakemake) as (inputs, _, output):
    measured = read_json(inputs.reconstruction)
    whole = [read_json(file) for file in inputs.camera_array]
    arrays = pd.DataFrame([*measured["arrays"], *whole])
    arrays = arrays.drop_duplicates(["scene", "cameras", "pixels"], keep="last")
    write_csv(output.camera_array, arrays.round(DECIMALS))
    write_csv(output.reconstruction, table_of(measured["rows"], decimals=DECIMALS))
