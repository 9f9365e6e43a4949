"""Write error against run time over all scenes: the table and its figures."""

import pandas as pd

from lfcore.evaluation.table_files import write_csv
from lfcore.evaluation.work_precision import figure, points
from lfcore.files import read_json
from lfcore.workflow.job import job

with job(snakemake) as (inputs, _, output):
    scenes = [read_json(path) for path in inputs]
    rows = pd.DataFrame([row for scene in scenes for row in scene["rows"]])
    for name, draw in (("on_the_fly", figure.on_the_fly), ("stored", figure.stored)):
        draw(output[name], rows, machine=scenes[0]["device"])
    write_csv(output.csv, points.table(rows))
