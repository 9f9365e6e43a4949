"""Rate and distortion over all scenes: the points, the delta rates, and a figure a scene."""

import pandas as pd

from lfcore.evaluation.storage.figures import rate_distortion_figure
from lfcore.evaluation.storage.rate_distortion import BD_COLUMNS, COLUMNS, bd_rows
from lfcore.evaluation.table_files import publish_table, read_rows, table_of
from workflow.job import job

with job(snakemake):
    given, output, params = snakemake.input, snakemake.output, snakemake.params
    rows = read_rows(given.rows)
    points = table_of(rows, COLUMNS)
    deltas = table_of(bd_rows(pd.DataFrame(rows)), BD_COLUMNS)
    files = zip(given.captions, output.csv, output.markdown, params.titles, strict=True)
    for table, (caption, csv, markdown, title) in zip((points, deltas), files, strict=True):
        publish_table(table, csv, markdown, title=title, caption=caption, config=params.config)
    for scene, figure in zip(params.scenes, output.figures, strict=True):
        rate_distortion_figure(figure, points[points.scene == scene], deltas[deltas.scene == scene])
