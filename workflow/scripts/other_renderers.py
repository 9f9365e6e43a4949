"""The same pictures by this program, POV-Ray and Mitsuba 3; what is not installed is left out."""

from lfcore.evaluation.renderers import COLUMNS, compare, renderers_sheet
from lfcore.evaluation.table_files import publish_table, table_of
from workflow.job import job, log_progress
from workflow.tracer import open_tracer

with job(snakemake):
    given, output, params = snakemake.input, snakemake.output, snakemake.params
    tracer = open_tracer(snakemake)
    focus = tracer.scene.focus_distances_m
    focus_m = (min(focus), max(focus))
    rows, rendered = compare(tracer, focus_m, **params.study, progress=log_progress("pictures"))
    for row in rows:
        if row["note"].startswith("left out"):
            print(f"{row['method']}, focus {row['focus_m']} m: {row['note']}")
    table = table_of(rows, COLUMNS)
    publish_table(
        table,
        output.csv,
        output.markdown,
        title=params.title,
        caption=given.caption,
        config=params.config,
    )
    renderers_sheet(output.figure, rendered, focus_m)
