"""One of the store's tables over all scenes, and its figure where it has one."""

from lfcore.evaluation import equivalence
from lfcore.evaluation.storage import layouts, retrieval
from lfcore.evaluation.storage.figures import layouts_figure, retrieval_figure
from lfcore.evaluation.table_files import publish_table, read_rows, table_of
from workflow.job import job

COLUMNS = {
    "storage_layouts": layouts.COLUMNS,
    "equivalence": equivalence.COLUMNS,
    "retrieval": retrieval.COLUMNS,
}
FIGURES = {"storage_layouts": layouts_figure, "retrieval": retrieval_figure}

with job(snakemake):
    given, output, name = snakemake.input, snakemake.output, snakemake.params.table
    table = table_of(read_rows(given.rows), COLUMNS[name])
    publish_table(
        table,
        output.csv,
        output.markdown,
        title=snakemake.params.title,
        caption=given.caption,
        config=snakemake.params.config,
    )
    if name in FIGURES:
        FIGURES[name](output.figure, table)
