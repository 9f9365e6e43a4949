"""Write tables as Markdown, and a page of tables and figures; captions may have measurements."""

from pathlib import Path

from lfcore import __version__
from lfcore.evaluation.page import Section, left_over, write_markdown_tables, write_page
from lfcore.files import read_json
from lfcore.timing import machine
from lfcore.workflow.job import job

with job(snakemake) as (inputs, params, output):
    here = machine()
    introduction, *captions = params.captions
    files = map(Path, inputs.reported)  # copies from object storage are in another folder
    sections = [
        Section(
            section["name"], section["title"], caption,
            next(files) if section["table"] else None,
            {label: next(files) for label in section["figures"]},
        )
        for section, caption in zip(params.sections, captions, strict=True)
    ]  # fmt: skip
    measured = {k: read_json(v) for k, v in zip(params.records, inputs.records, strict=True)}
    config = {**params.config, "measured": measured}
    devices = sorted({read_json(file)["device"] for file in inputs.traced})
    write_markdown_tables(output.markdown, sections, config)
    viewers = list(map(Path, inputs.viewers))
    left = left_over(Path(output.page), sections, viewers)
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
            **({"of earlier runs, not shown": ", ".join(left)} if left else {}),
        },
        viewers=viewers,
        config=config,
    )
