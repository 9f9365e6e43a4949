"""One page over tables and figures; captions may speak of what was measured."""

from pathlib import Path

from lfcore import __version__
from lfcore.evaluation.page import Section, write_page
from lfcore.evaluation.timing import machine
from lfcore.files import read_json
from lfcore.workflow.job import job


def text(file):
    return Path(file).read_text(encoding="utf-8")


with job(snakemake.log[0], snakemake.threads):
    given, params, here = snakemake.input, snakemake.params, machine()
    introduction, *captions = map(text, given.captions)
    sections = [
        Section(one.name, one.title, caption, one.table and Path(one.table),
                {label: Path(file) for label, file in one.figures.items()})
        for one, caption in zip(params.sections, captions, strict=True)
    ]  # fmt: skip
    records = zip(params.records, given.records, strict=True)
    measured = {name: read_json(file) for name, file in records}
    devices = sorted({read_json(file)["device"] for file in given.traced})
    write_page(
        snakemake.output[0],
        sections,
        title=params.title,
        introduction=introduction,
        facts={
            "machine": f"{here['processor']}, {here['cores']} cores, {here['memory_gib']} GiB",
            **({"OpenCL device": ", ".join(devices)} if devices else {}),
            "system": f"{here['system']}, Python {here['python']}, lfcore {__version__}",
            **params.facts,
        },
        viewers=map(Path, given.viewers),
        config={**params.config, "measured": measured},
    )
