"""The thesis's tables over all scenes, as CSV and Markdown."""

import math

from lfcore.evaluation.table_files import publish_table
from lfcore.evaluation.tables import SPECS, make_table
from lfcore.files import read_json
from workflow.job import job

with job(snakemake):
    scenes = [read_json(path) for path in snakemake.input.records]
    given, output = snakemake.input, snakemake.output
    outputs = zip(snakemake.params.tables, given.captions, output.csv, output.markdown, strict=True)
    for name, caption, csv, markdown in outputs:
        records = [row for scene in scenes for row in scene[name]]
        for row in records:
            if row.get("psnr_db", 0) is None:
                row["psnr_db"] = math.inf
        table = make_table(name, records)
        publish_table(
            table,
            csv,
            markdown,
            title=SPECS[name].title,
            caption=caption,
            config=snakemake.params.config,
        )
