"""One of the store's tables over all scenes, and its figure where it has one."""

from pathlib import Path

from lfcore.evaluation import equivalence
from lfcore.evaluation.captions import fill
from lfcore.evaluation.storage import layouts, retrieval
from lfcore.evaluation.storage.figures import layouts_figure, retrieval_figure
from lfcore.evaluation.storage.table import make_table, read_rows
from lfcore.evaluation.tables import write_csv, write_markdown
from workflow.job import job

COLUMNS = {
    "storage_layouts": layouts.COLUMNS,
    "equivalence": equivalence.COLUMNS,
    "retrieval": retrieval.COLUMNS,
}
FIGURES = {"storage_layouts": layouts_figure, "retrieval": retrieval_figure}

with job(snakemake):
    given, output, name = snakemake.input, snakemake.output, snakemake.params.table
    table = make_table(read_rows(given.rows), COLUMNS[name])
    write_csv(output.csv, table)
    text = fill(Path(given.caption).read_text(encoding="utf-8"), snakemake.params.config)
    write_markdown(output.markdown, table, title=snakemake.params.title, caption=text)
    if name in FIGURES:
        FIGURES[name](output.figure, table)
