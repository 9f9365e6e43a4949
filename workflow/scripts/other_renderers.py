"""The same pictures by this program, POV-Ray and Mitsuba 3; what is not installed is left out."""

from pathlib import Path

from lfcore.evaluation.captions import fill
from lfcore.evaluation.renderers import COLUMNS, compare, renderers_sheet
from lfcore.evaluation.storage.table import make_table
from lfcore.evaluation.tables import write_csv, write_markdown
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
    table = make_table(rows, COLUMNS)
    write_csv(output.csv, table)
    text = fill(Path(given.caption).read_text(encoding="utf-8"), params.config)
    write_markdown(output.markdown, table, title=params.title, caption=text)
    renderers_sheet(output.figure, rendered, focus_m)
