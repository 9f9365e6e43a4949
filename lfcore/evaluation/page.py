"""One page over all tables and figures, self-contained: it opens from disk and can be mailed.

The page has no built-in sections.  Captions are reStructuredText with Jinja expressions, as in
Snakemake's reports.
"""

import base64
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import docutils.core
import jinja2
import pandas as pd

from lfcore.errors import printable
from lfcore.evaluation.table_files import UNKNOWN, readable, readable_name, write_markdown
from lfcore.files import write_text

HERE = Path(__file__).parent
MOST_ROWS = 20
"""The most rows of an unfolded table: the thesis's have 18."""


@dataclass(frozen=True)
class Section:
    """A table (CSV), figures, or both, under one title and caption.

    ``figures`` maps a label (a scene's name, or empty) to a PNG file.
    """

    name: str
    title: str
    caption: str = ""
    table: Path | None = None
    figures: Mapping[str, Path] = field(default_factory=dict)


def write_page(
    path: str | Path,
    sections: Sequence[Section],
    *,
    title: str,
    introduction: str,
    facts: Mapping[str, object],
    config: Mapping[str, object],
    viewers: Iterable[Path] = (),
) -> None:
    """Write ``index.html``.

    ``introduction`` is reStructuredText, ``facts`` are machine, device and versions, ``config`` is
    ``snakemake.config`` in captions, and ``viewers`` are pages of light fields, in this page's
    folder or below, named for their scenes.  Raises :class:`OSError` for a table or picture that
    cannot be read.
    """
    folder = Path(path).parent
    template = jinja2.Template(
        (HERE / "page.html").read_text(encoding="utf-8"), autoescape=True,
        undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True,
        keep_trailing_newline=True,
        finalize=lambda value: value if hasattr(value, "__html__") else printable(str(value)),
    )  # fmt: skip
    text = template.render(
        title=title,
        style=(HERE / "page.css").read_text(encoding="utf-8"),
        introduction=to_html(introduction, config),
        facts=facts,
        viewers={file.relative_to(folder).as_posix(): file.stem for file in viewers},
        sections=[_shown(section, folder, config) for section in sections],
    )
    write_text(path, text)


def left_over(page: Path, sections: Sequence[Section], viewers: Sequence[Path]) -> list[str]:
    """The tables, figures and pages of other configurations in the page's folder."""
    tables = [section.table for section in sections if section.table]
    figures = [file for section in sections for file in section.figures.values()]
    names = {page.name, *(file.name for file in (*tables, *figures, *viewers))}
    # A table also has a Markdown file, and may have a table of its cases.
    names |= {f"{file.stem}{end}" for file in tables for end in (".md", "_cases.csv")}
    files = (file for end in ("csv", "md", "png", "html") for file in page.parent.rglob(f"*.{end}"))
    return sorted(file.relative_to(page.parent).as_posix() for file in files
                  if file.name not in names)  # fmt: skip


def write_markdown_tables(
    paths: Iterable[str | Path], sections: Iterable[Section], config: Mapping[str, object]
) -> None:
    """Write each section's table to the next of ``paths``, with its caption.

    Raises :class:`ValueError` unless there is a path for every table; otherwise as
    :func:`write_page`.
    """
    with_table = [section for section in sections if section.table is not None]
    for path, section in zip(paths, with_table, strict=True):
        values = pd.read_csv(section.table)
        caption = fill(section.caption, config, values)
        write_markdown(path, values, title=section.title, caption=caption)


def _shown(section: Section, folder: Path, config: Mapping[str, object]) -> dict[str, Any]:
    """A section for the template; columns are (name, class of the cells)."""
    table = pd.read_csv(section.table) if section.table else pd.DataFrame()
    text, same = _varied(readable(table))
    numbers = {readable_name(name) for name in table.select_dtypes("number")}
    files = [section.table, section.table.with_suffix(".md")] if section.table else []
    return {
        "name": section.name,
        "title": section.title,
        "figures": {label: _data_url(picture) for label, picture in section.figures.items()},
        "caption": to_html(section.caption, config, table),
        "same": same,
        "folded": len(text) > MOST_ROWS,
        "columns": [
            (name, "number" * (name.removesuffix(" (thesis)") in numbers)) for name in text.columns
        ],
        "rows": text.to_numpy().tolist(),
        "files": [file.name for file in files if file.parent == folder and file.exists()],
    }


def _varied(text: pd.DataFrame) -> tuple[pd.DataFrame, dict[str, str]]:
    """The first column and those that differ between rows, and the values of the others."""
    same = {
        name: text[name].iloc[0]
        for name in text.columns[1:]
        if len(text) > 1 and text[name].nunique() == 1
    }
    shared = {name: value for name, value in same.items() if value != UNKNOWN}
    return text.drop(columns=list(same)), shared


def _data_url(picture: Path) -> str:
    return f"data:image/png;base64,{base64.b64encode(picture.read_bytes()).decode('ascii')}"


def fill(text: str, config: Mapping[str, object], table: pd.DataFrame | None = None) -> str:
    """``text`` with its Jinja expressions filled in; they see ``snakemake.config`` and ``table``.

    Raises :class:`jinja2.UndefinedError` for an unknown name.
    """
    template = jinja2.Template(text, undefined=jinja2.StrictUndefined)
    return template.render(snakemake=SimpleNamespace(config=config), table=table)


def to_html(text: str, config: Mapping[str, object], table: pd.DataFrame | None = None) -> str:
    """HTML of a filled-in caption, without raw HTML or included files.

    Raises :class:`docutils.utils.SystemMessage` for invalid reStructuredText.
    """
    parts = docutils.core.publish_parts(
        fill(text, config, table),
        writer="html5",
        settings_overrides={
            "report_level": 2,
            "halt_level": 2,
            "raw_enabled": False,
            "file_insertion_enabled": False,
        },
    )
    return parts["body"]
