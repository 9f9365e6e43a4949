"""Write a data set from its shards: the folder of items, tables, card and page."""

from pathlib import Path

from lfcore import __version__
from lfcore.datasets.card import check_refused, tables, write_card, write_report
from lfcore.datasets.description import Description
from lfcore.datasets.stored import unpack
from lfcore.evaluation.table_files import write_csv
from lfcore.files import read_json, write_json
from lfcore.workflow.job import job
from lfcore.workflow.versions import commit

with job(snakemake) as (inputs, params, output):
    description, folder = Description.check(params.description), Path(output[0])
    records = [record for file in inputs.records for record in read_json(file)]
    check_refused(records)
    unpack(description, inputs.shards, folder / "data")
    contents = tables(description, records, folder / "data")
    files = {name: folder / f"{name}.csv" for name in contents}
    for name, file in files.items():
        write_csv(file, contents[name])
    # JSON is YAML.
    write_json(folder / "description.yaml", {"dataset": description.model_dump()})
    code = f"{__version__}, commit {commit()}" if commit() else __version__
    place = f"{params.folder}/description.yaml"
    command = f"snakemake --cores 2 {params.folder}/ --configfile {place}"
    write_card(folder / "croissant.json", description, files, command=command, code=code)
    facts = {
        "items": ", ".join(
            f"{n} {name}" for name, n in contents["items"].split.value_counts().items()
        ),
        "licence": description.licence or "not given",
        "refused": len(contents["refused"]),
        "seed": description.seed,
        "lfcore": code,
        "core seconds per item": round(contents["seconds"]["core_seconds"].mean(), 2),
    }
    write_report(folder / "index.html", description, records, inputs.shards, files, facts)
