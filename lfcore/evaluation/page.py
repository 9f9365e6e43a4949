"""One page over all tables and figures, self-contained: it opens from disk and can be mailed.

Sections are whatever the workflow made; the page knows none of them by name.  Captions are
reStructuredText with Jinja expressions, the form that Snakemake's own reports take.
"""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace

import docutils.core
import jinja2
import pandas as pd

from lfcore.evaluation.table_files import readable, write_markdown
from lfcore.files import write_text

STYLE = Path(__file__).with_name("page.css")
MEDIA_TYPES = {".png": "image/png", ".jpg": "image/jpeg", ".svg": "image/svg+xml"}


@dataclass(frozen=True)
class Section:
    """A table (CSV), figures, or both, under one title and caption.

    ``figures`` maps a label (a scene's name, or empty) to a picture file.
    """

    name: str
    title: str
    caption: str = ""
    table: Path | None = None
    figures: Mapping[str, Path] = field(default_factory=dict)

    @property
    def files(self) -> list[str]:
        """The table and the figures."""
        tables = [self.table] if self.table else []
        return [str(file) for file in (*tables, *self.figures.values())]


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

    Parameters
    ----------
    introduction : reStructuredText above everything.
    facts : name and value of what stands at the top: machine, device, versions.
    viewers : pages of light fields, in this page's folder or below, named for their scenes.
    config : what captions see as ``snakemake.config``.

    Raises
    ------
    OSError
        when a table or picture cannot be read.
    ValueError
        when a figure is of a type that a page cannot show.
    """
    folder = Path(path).parent
    contents = "".join(f'<a href="#{s.name}">{html.escape(s.title)}</a>' for s in sections)
    beside = "".join(
        f'<a href="{html.escape(file.relative_to(folder).as_posix())}">'
        f"Look around in {html.escape(file.stem)}</a>"
        for file in viewers
    )
    body = "\n".join(_section(section, folder, config) for section in sections)
    rows = "".join(
        f"<dt>{html.escape(str(k))}</dt><dd>{html.escape(str(v))}</dd>" for k, v in facts.items()
    )
    write_text(
        path,
        f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{html.escape(title)}</title>
<style>{STYLE.read_text(encoding="utf-8")}</style>
</head>
<body>
<header>
<h1>{html.escape(title)}</h1>
{to_html(introduction, config)}
<dl>{rows}</dl>
<nav>{beside}{contents}</nav>
</header>
<main>
{body}
</main>
</body>
</html>
""",
    )


def write_markdown_tables(
    paths: Iterable[str | Path], sections: Iterable[Section], config: Mapping[str, object]
) -> None:
    """Write the table of each section that has one to the next of ``paths``, with its caption.

    Raises :class:`ValueError` unless there is a path for every table; otherwise as
    :func:`write_page`.
    """
    tables = [(one, one.table) for one in sections if one.table is not None]
    for path, (section, table) in zip(paths, tables, strict=True):
        caption = fill(section.caption, config)
        write_markdown(path, pd.read_csv(table), title=section.title, caption=caption)


def _section(section: Section, folder: Path, config: Mapping[str, object]) -> str:
    parts = [f'<section id="{html.escape(section.name)}"><h2>{html.escape(section.title)}</h2>']
    parts += [_figure(label, picture) for label, picture in section.figures.items()]
    if section.table is not None:
        parts.append(_table(pd.read_csv(section.table)))
    parts.append(f'<div class="caption">{to_html(section.caption, config)}</div>')
    if section.table is not None:
        parts.append(_links(section.table, folder))
    return "\n".join([*parts, "</section>"])


def _figure(label: str, picture: Path) -> str:
    media = MEDIA_TYPES.get(picture.suffix.lower())
    if media is None:
        raise ValueError(f"{picture}: a page shows {', '.join(MEDIA_TYPES)}, not this")
    data = base64.b64encode(picture.read_bytes()).decode("ascii")
    name = html.escape(label)
    caption = f"<figcaption>{name}</figcaption>" if label else ""
    return f'<figure>{caption}<img alt="{name}" src="data:{media};base64,{data}"></figure>'


def _table(table: pd.DataFrame) -> str:
    shown = readable(table)
    kinds = []
    for column, source in zip(shown.columns, table.columns, strict=True):
        number = pd.api.types.is_numeric_dtype(table[source])
        thesis = "thesis" if column.startswith("thesis") else ""
        kinds.append(" ".join(filter(None, ("number" if number else "", thesis))))
    head = "".join(
        f'<th class="{kind}">{html.escape(column)}</th>'
        for kind, column in zip(kinds, shown.columns, strict=True)
    )
    body, previous = [], None
    for row in shown.itertuples(index=False):
        mark = ' class="first"' if previous is not None and row[0] != previous else ""
        previous = row[0]
        cells = "".join(
            f'<td class="{kind}">{html.escape(str(cell))}</td>'
            for kind, cell in zip(kinds, row, strict=True)
        )
        body.append(f"<tr{mark}>{cells}</tr>")
    rows = "\n".join(body)
    return f'<div class="table"><table><thead><tr>{head}</tr></thead>\n{rows}</table></div>'


def _links(table: Path, folder: Path) -> str:
    files = [f for f in (table, table.with_suffix(".md")) if f.exists() and f.parent == folder]
    links = ", ".join(f'<a href="{html.escape(f.name)}">{html.escape(f.name)}</a>' for f in files)
    return f'<p class="files">{links}</p>' if links else ""


def fill(text: str, config: Mapping[str, object]) -> str:
    """``text`` with its Jinja expressions filled in; they see ``snakemake.config``.

    Raises
    ------
    jinja2.UndefinedError
        for a name that is not there.
    """
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, autoescape=False)
    return environment.from_string(text).render(snakemake=SimpleNamespace(config=config))


def to_html(text: str, config: Mapping[str, object]) -> str:
    """HTML of a filled-in caption, without raw HTML or included files.

    Raises
    ------
    docutils.utils.SystemMessage
        for reStructuredText with a mistake.
    """
    parts = docutils.core.publish_parts(
        fill(text, config),
        writer="html5",
        settings_overrides={
            "report_level": 2,
            "halt_level": 2,
            "raw_enabled": False,
            "file_insertion_enabled": False,
        },
    )
    return parts["body"]
