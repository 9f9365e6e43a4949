"""One page over all tables and figures."""

from pathlib import Path

from lfcore import __version__
from lfcore.evaluation.page import Section, write_page
from lfcore.evaluation.timing import machine
from lfcore.files import read_json
from workflow.job import job


def sections(wanted, captions):
    """The sections of the page; one caption file each, in the same order."""
    made = []
    for (name, section), caption in zip(wanted.items(), captions, strict=True):
        figures = {label: Path(file) for label, file in section.get("figures", {}).items()}
        table = Path(section["table"]) if "table" in section else None
        text = Path(caption).read_text(encoding="utf-8")
        made.append(Section(name, section["title"], text, table, figures))
    return made


with job(snakemake):
    introduction, *captions = snakemake.input.captions
    config, here = snakemake.params.config, machine()
    devices = {read_json(path)["device"] for path in snakemake.input.traced}
    write_page(
        snakemake.output[0],
        sections(snakemake.params.sections, captions),
        title="Synthetic light fields: tables and figures",
        introduction=Path(introduction).read_text(encoding="utf-8"),
        facts={
            "machine": f"{here['processor']}, {here['cores']} cores, {here['memory_gib']} GiB",
            "OpenCL device": ", ".join(sorted(devices)),
            "system": f"{here['system']}, Python {here['python']}, lfcore {__version__}",
            "M": config["spatial_resolution"],
            "N": ", ".join(map(str, sorted(config["angular_resolutions"]))),
        },
        config=config,
    )
