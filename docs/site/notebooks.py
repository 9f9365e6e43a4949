"""Notebooks of tutorials, from the same Markdown."""

import re
from pathlib import Path

import nbformat
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from docs.site.pages import LANGUAGES, PICTURE, VIEWER, Page

CODE = re.compile(rf"^```({'|'.join(LANGUAGES)})\n(.*?)^```$", re.MULTILINE | re.DOTALL)
COMMENT = re.compile(r"^<!-- .*? -->$", re.MULTILINE)
SHOW = {
    PICTURE: r'```python\nfrom IPython.display import Image\n\nImage("\1")\n```',
    VIEWER: r'```python\nfrom IPython.display import IFrame\n\nIFrame("\1", "100%", 640)\n```',
}


def notebook(page: Page) -> nbformat.NotebookNode:
    """The page as cells: text, commands for the shell, Python, and the pictures, shown."""
    text = page.text
    for what, code in SHOW.items():
        text = what.sub(code, text)
    words, *rest = CODE.split(COMMENT.sub("", text))
    cells = [new_markdown_cell(words.strip())]
    for language, code, words in zip(rest[::3], rest[1::3], rest[2::3], strict=True):
        cells.append(new_code_cell(("%%bash\n" if language == "bash" else "") + code.strip()))
        if words.strip():
            cells.append(new_markdown_cell(words.strip()))
    for number, cell in enumerate(cells):
        cell["id"] = f"{page.name}-{number}"  # the same notebook each time it is made
    kernel = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    return new_notebook(cells=cells, metadata=kernel)


def write(page: Page, folder: Path) -> Path:
    """Write NAME.ipynb into the folder."""
    made = notebook(page)
    nbformat.validate(made)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{page.name}.ipynb"
    path.write_text(nbformat.writes(made), encoding="utf-8")
    return path
