"""A data set from its shards: the folder of items, tables, card and page."""

import subprocess
from pathlib import Path

from lfcore.datasets.card import tables, write_card, write_report
from lfcore.datasets.description import Description
from lfcore.datasets.items import unpack
from lfcore.evaluation.table_files import write_csv
from lfcore.files import read_json, write_json
from lfcore.workflow.job import job

with job(snakemake) as (given, params, output):
    description = Description.check(params.description)
    records = [one for file in given.records for one in read_json(file)]
    unpack(description, given.shards, Path(output.data))
    made = tables(description, records, Path(output.data))
    files = {Path(file).stem: Path(file) for file in output.tables}
    for name, file in files.items():
        write_csv(file, made[name])
    commit = subprocess.run(
        ["git", "rev-parse", "HEAD"], capture_output=True, text=True, check=False
    ).stdout.strip()
    write_json(output.description, {"dataset": description.model_dump()})  # which YAML includes
    folder = Path(output.card).parent
    command = f"snakemake --cores 2 {folder}/ --configfile {output.description}"
    write_card(output.card, description, files, command=command, commit=commit or "unknown")
    facts = {
        "items": len(made["items"]),
        "refused": len(made["refused"]),
        "seed": description.seed,
        "commit": commit or "unknown",
        "core seconds per item": round(made["seconds"]["core_seconds"].mean(), 2),
    }
    write_report(Path(output.page), description, records, given.shards, files, facts)
