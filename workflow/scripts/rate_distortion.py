"""Write rate and distortion over all scenes: points, delta rates, and a figure per scene."""

import pandas as pd

from lfcore.evaluation.storage.figures import rate_distortion_figure
from lfcore.evaluation.storage.rate_distortion import COLUMNS, bd_rows
from lfcore.evaluation.table_files import read_rows, table_of, write_csv
from lfcore.workflow.job import job

with job(snakemake) as (inputs, params, output):
    rows = read_rows(inputs)
    points = table_of(rows, COLUMNS)
    deltas = table_of(bd_rows(pd.DataFrame(rows)))
    write_csv(output.rate_distortion, points)
    write_csv(output.bd_rate, deltas)
    for scene, figure in zip(params.scenes, output.figures, strict=True):
        rate_distortion_figure(figure, points[points.scene == scene], deltas[deltas.scene == scene])
