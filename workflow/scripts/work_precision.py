"""Work-precision diagrams and their tables over all scenes."""

import pandas as pd

from lfcore.evaluation.table_files import write_csv
from lfcore.evaluation.work_precision import figure
from lfcore.evaluation.work_precision.convergence import convergence
from lfcore.evaluation.work_precision.measured_point import COLUMNS, rounded
from lfcore.files import read_json
from lfcore.workflow.job import job

with job(snakemake.log[0], snakemake.threads):
    output = snakemake.output
    scenes = [read_json(path) for path in snakemake.input]
    points = pd.DataFrame([row for one in scenes for row in one["rows"]])
    machine = f"{scenes[0]['device']}, {scenes[0]['threads']} thread"
    for panel, file in zip(snakemake.params.panels, output.figures, strict=True):
        figure.draw(panel, file, points, machine=machine)
    orders = convergence(points[points.panel == "quadrature"])
    write_csv(output.convergence, rounded(pd.DataFrame(orders)))
    write_csv(output.csv, rounded(points[list(COLUMNS)]))
