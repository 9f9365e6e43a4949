"""The assignment's page: all figures and tables, and captions that answer with measurements."""

from pathlib import Path

from lfcore import __version__
from lfcore.evaluation.page import Section, write_page
from lfcore.evaluation.timing import machine
from lfcore.files import read_json
from workflow.job import job


def text(file):
    return Path(file).read_text(encoding="utf-8")


with job(snakemake):
    given, params, here = snakemake.input, snakemake.params, machine()
    figures = zip(params.figures.items(), given.figure_captions, given.figures, strict=True)
    sections = [
        Section(name, title, text(caption), figures={"": Path(file)})
        for (name, title), caption, file in figures
    ]
    tables = zip(params.tables.items(), given.table_captions, given.tables, strict=True)
    sections += [
        Section(f"table_{name}", title, text(caption), Path(file))
        for (name, title), caption, file in tables
    ]
    # Captions see what was measured beside the configuration.
    measured = {
        name: read_json(file) for name, file in zip(params.records, given.records, strict=True)
    }
    write_page(
        snakemake.output[0],
        sections,
        title="The light field camera",
        introduction=text(given.introduction),
        facts={
            "machine": f"{here['processor']}, {here['cores']} cores, {here['memory_gib']} GiB",
            "system": f"{here['system']}, Python {here['python']}, lfcore {__version__}",
        },
        config={**params.config, "measured": measured},
    )
