"""Tables as Markdown, and one page over tables and figures; captions may say what was measured."""

from pathlib import Path

from lfcore import __version__
from lfcore.evaluation.page import Section, write_markdown_tables, write_page
from lfcore.files import read_json
from lfcore.timing import machine
from lfcore.workflow.job import job

with job(snakemake) as (given, params, output):
    here = machine()
    introduction, *captions = params.captions
    files = map(Path, given.reported)  # from object storage they come to another folder
    sections = [
        Section(
            one["name"], one["title"], caption, next(files) if one["table"] else None,
            {label: next(files) for label in one["figures"]},
        )
        for one, caption in zip(params.sections, captions, strict=True)
    ]  # fmt: skip
    measured = {k: read_json(v) for k, v in zip(params.records, given.records, strict=True)}
    config = {**params.config, "measured": measured}
    devices = sorted({read_json(file)["device"] for file in given.traced})
    write_markdown_tables(output.markdown, sections, config)
    write_page(
        output.page,
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
        config=config,
    )
