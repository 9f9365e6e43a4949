"""What all scenes leave out, as one table."""

import pandas as pd

from lfcore.evaluation.left_out.bench import COLUMNS
from lfcore.evaluation.table_files import publish_table
from lfcore.files import read_json
from workflow.job import job

with job(snakemake):
    given, output = snakemake.input, snakemake.output
    rows = [row for path in given.rows for row in read_json(path)["rows"]]
    table = pd.DataFrame(rows, columns=COLUMNS)
    table = table.round({"seconds_full": 4, "seconds_left_out": 4})
    publish_table(
        table,
        output.csv,
        output.markdown,
        title="Nothing a scene does not need",
        caption=given.caption,
        config=snakemake.params.config,
    )
