"""The same pictures by this program, POV-Ray and Mitsuba 3; what is not installed is left out."""

from pathlib import Path

from lfcore.evaluation.captions import fill
from lfcore.evaluation.renderers import COLUMNS, compare, renderers_sheet
from lfcore.evaluation.storage.table import make_table
from lfcore.evaluation.tables import write_csv, write_markdown
from lfcore.opencl.device import open_device
from lfcore.scene.files import load_scene
from lfcore.tracing.bvh import load_bvh
from lfcore.tracing.tracer import Tracer
from workflow.job import job, log_progress

with job(snakemake):
    given, output, params = snakemake.input, snakemake.output, snakemake.params
    scene = load_scene(given.scene)
    device = open_device(params.device or None, threads=snakemake.threads)
    focus_m = (min(scene.focus_distances_m), max(scene.focus_distances_m))
    rows, rendered = compare(
        Tracer(scene, load_bvh(given.bvh), device),
        focus_m,
        **params.study,
        progress=log_progress("pictures"),
    )
    for row in rows:
        if row["note"].startswith("left out"):
            print(f"{row['method']}, focus {row['focus_m']} m: {row['note']}")
    table = make_table(rows, COLUMNS)
    write_csv(output.csv, table)
    text = fill(Path(given.caption).read_text(encoding="utf-8"), params.config)
    write_markdown(output.markdown, table, title=params.title, caption=text)
    renderers_sheet(output.figure, rendered, focus_m)
