"""The assignment's tables, as CSV and Markdown."""

from operator import itemgetter

from lfcore.evaluation.camera_arrays import make_array_table
from lfcore.evaluation.table_files import publish_table
from lfcore.files import read_json
from workflow.job import job

with job(snakemake):
    given, output, params = snakemake.input, snakemake.output, snakemake.params
    measured = read_json(given.reconstruction)
    whole = [read_json(file) for file in given.camera_array]
    # The sweep's array of the same size is the same row.
    size = itemgetter("scene", "cameras", "pixels")
    known = {size(row) for row in whole}
    swept = [row for row in measured["arrays"] if size(row) not in known]
    records = {"camera_array": swept + whole, "reconstruction": measured["rows"]}
    outputs = zip(params.titles.items(), given.captions, output.csv, output.markdown, strict=True)
    for (name, title), caption, csv, markdown in outputs:
        table = make_array_table(name, records[name])
        publish_table(table, csv, markdown, title=title, caption=caption, config=params.config)
