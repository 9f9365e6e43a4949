"""Notebooks of tutorials, from the same Markdown."""

from __future__ import annotations

import re
from pathlib import Path

import nbformat
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from docs.site.pages import LANGUAGES, Page

SPLIT = re.compile(
    r"^```(?P<language>\w+)\n(?P<code>.*?)^```$"
    r"|^<!-- picture: (?P<picture>\S+) \| (?P<words>.*?) -->$"
    r"|^<!-- viewer: (?P<viewer>\S+) \| .*? -->$"
    r"|^<!-- .*? -->$",
    re.MULTILINE | re.DOTALL,
)


def notebook(page: Page) -> nbformat.NotebookNode:
    """The page as cells: text, commands for the shell, Python, and what was made, shown."""
    cells, text, start = [], "", 0
    for match in SPLIT.finditer(page.text):
        text += page.text[start : match.start()]
        start = match.end()
        found = match.groupdict()
        if found["language"] and found["language"] not in LANGUAGES:
            text += match[0]
            continue
        code = _code(found)
        if code:
            cells += [new_markdown_cell(text.strip())] if text.strip() else []
            cells.append(new_code_cell(code))
            text = ""
    text += page.text[start:]
    cells += [new_markdown_cell(text.strip())] if text.strip() else []
    for number, cell in enumerate(cells):
        cell["id"] = f"{page.name}-{number}"  # the same notebook whenever it is made
    kernel = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    return new_notebook(cells=cells, metadata=kernel)


def _code(found: dict[str, str | None]) -> str:
    """What stands in a cell; "" for a comment that means nothing there."""
    if found["language"] == "bash":
        return f"%%bash\n{(found['code'] or '').strip()}"
    if found["language"]:
        return (found["code"] or "").strip()
    if found["picture"]:
        show = f'from IPython.display import Image\n\nImage("{found["picture"]}")'
        return f"# {found['words']}\n{show}"
    if found["viewer"]:
        show = f'from IPython.display import IFrame\n\nIFrame("{found["viewer"]}", "100%", 640)'
        return show
    return ""


def write(page: Page, folder: Path) -> Path:
    """Write NAME.ipynb into the folder."""
    made = notebook(page)
    nbformat.validate(made)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{page.name}.ipynb"
    path.write_text(nbformat.writes(made), encoding="utf-8")
    return path
