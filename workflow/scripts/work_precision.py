"""Work-precision diagrams and their table over all scenes."""

from pathlib import Path

import pandas as pd

from lfcore.evaluation.captions import fill
from lfcore.evaluation.files import read_json
from lfcore.evaluation.tables import write_csv, write_markdown
from lfcore.evaluation.work_precision.figure import storage, work_precision
from lfcore.evaluation.work_precision.point import COLUMNS, rounded
from workflow.job import job

with job(snakemake):
    given, output = snakemake.input, snakemake.output
    scenes = [read_json(path) for path in given.rows]
    points = pd.DataFrame([row for one in scenes for row in one["rows"]], columns=COLUMNS)
    machine = f"{scenes[0]['device']}, {scenes[0]['threads']} thread"
    for panel, figure in zip(snakemake.params.panels, output.figures, strict=True):
        if panel == "storage":
            storage(figure, points)
        else:
            work_precision(figure, points[points.panel == panel], machine=machine)
    table = rounded(points)
    write_csv(output.csv, table)
    text = fill(Path(given.caption).read_text(encoding="utf-8"), snakemake.params.config)
    write_markdown(output.markdown, table, title="Error against run time", caption=text)
