"""Work-precision diagrams and their tables over all scenes."""

import pandas as pd

from lfcore.evaluation.table_files import publish_table, write_csv
from lfcore.evaluation.work_precision import figure
from lfcore.evaluation.work_precision.point import COLUMNS, check_trusted, rounded
from lfcore.evaluation.work_precision.quadrature import convergence
from lfcore.files import read_json
from workflow.job import job


def draw(panel, file, points, machine):
    """One figure; ``points`` have columns of kinds of pixels beside the table's."""
    rows = points[points.panel == panel]
    if panel == "storage":
        figure.storage(file, rows, machine=machine)
    elif panel == "convergence":
        figure.convergence(file, points[points.panel == "quadrature"])
    else:
        figure.work_precision(file, rows, machine=machine)


with job(snakemake):
    given, output = snakemake.input, snakemake.output
    scenes = [read_json(path) for path in given.rows]
    rows = [row for one in scenes for row in one["rows"]]
    check_trusted(rows)
    points = pd.DataFrame(rows)
    machine = f"{scenes[0]['device']}, {scenes[0]['threads']} thread"
    for panel, file in zip(snakemake.params.panels, output.figures, strict=True):
        draw(panel, file, points, machine)
    orders = convergence([row for row in rows if row["panel"] == "quadrature"])
    write_csv(output.convergence, rounded(pd.DataFrame(orders)))
    table = rounded(points[list(COLUMNS)])
    publish_table(
        table,
        output.csv,
        output.markdown,
        title="Error against run time",
        caption=given.caption,
        config=snakemake.params.config,
    )
