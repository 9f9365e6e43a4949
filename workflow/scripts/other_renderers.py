"""Render the same pictures by lfcore, POV-Ray and Mitsuba 3, as far as these are installed."""

from lfcore.evaluation.renderers.comparison import compare, renderers_sheet
from lfcore.evaluation.table_files import table_of, write_csv
from lfcore.workflow.batch import open_tracer
from lfcore.workflow.job import job

with job(snakemake) as (_, params, output):
    tracer = open_tracer(snakemake)
    focus = tracer.scene.focus_distances_m
    focus_m = (min(focus), max(focus))
    rows, rendered = compare(tracer, focus_m, **params.study)
    for row in rows:
        if row["note"].startswith("left out"):
            print(f"{row['method']}, focus {row['focus_m']} m: {row['note']}")
    write_csv(output.csv, table_of(rows))
    renderers_sheet(output.figure, rendered, focus_m)
