"""What all scenes leave out, as one table."""

from pathlib import Path

import pandas as pd

from lfcore.evaluation.captions import fill
from lfcore.evaluation.left_out.bench import COLUMNS
from lfcore.evaluation.tables import write_csv, write_markdown
from lfcore.files import read_json
from workflow.job import job

with job(snakemake):
    given, output = snakemake.input, snakemake.output
    rows = [row for path in given.rows for row in read_json(path)["rows"]]
    table = pd.DataFrame(rows, columns=COLUMNS)
    table = table.round({"seconds_full": 4, "seconds_left_out": 4})
    write_csv(output.csv, table)
    text = fill(Path(given.caption).read_text(encoding="utf-8"), snakemake.params.config)
    write_markdown(output.markdown, table, title="Nothing a scene does not need", caption=text)
