"""Rate and distortion over all scenes: the points, the delta rates, and a figure a scene."""

from pathlib import Path

import pandas as pd

from lfcore.evaluation.captions import fill
from lfcore.evaluation.storage.figures import rate_distortion_figure
from lfcore.evaluation.storage.rate_distortion import BD_COLUMNS, COLUMNS, bd_rows
from lfcore.evaluation.storage.table import make_table, read_rows
from lfcore.evaluation.tables import write_csv, write_markdown
from workflow.job import job

with job(snakemake):
    given, output, params = snakemake.input, snakemake.output, snakemake.params
    rows = read_rows(given.rows)
    points = make_table(rows, COLUMNS)
    deltas = make_table(bd_rows(pd.DataFrame(rows)), BD_COLUMNS)
    files = zip(given.captions, output.csv, output.markdown, params.titles, strict=True)
    for table, (caption, csv, markdown, title) in zip((points, deltas), files, strict=True):
        write_csv(csv, table)
        text = fill(Path(caption).read_text(encoding="utf-8"), params.config)
        write_markdown(markdown, table, title=title, caption=text)
    for scene, figure in zip(params.scenes, output.figures, strict=True):
        rate_distortion_figure(figure, points[points.scene == scene], deltas[deltas.scene == scene])
