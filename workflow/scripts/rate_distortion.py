"""Rate and distortion over all scenes: the points, the delta rates, and a figure a scene."""

import pandas as pd

from lfcore.evaluation.storage.figures import rate_distortion_figure
from lfcore.evaluation.storage.rate_distortion import COLUMNS, bd_rows
from lfcore.evaluation.table_files import read_rows, table_of, write_csv
from lfcore.workflow.job import job

with job(snakemake) as (given, params, output):
    rows = read_rows(given)
    points = table_of(rows, COLUMNS)
    deltas = table_of(bd_rows(pd.DataFrame(rows)))
    write_csv(output.rate_distortion, points)
    write_csv(output.bd_rate, deltas)
    for scene, figure in zip(params.scenes, output.figures, strict=True):
        rate_distortion_figure(figure, points[points.scene == scene], deltas[deltas.scene == scene])
