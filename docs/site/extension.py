"""The manual's own extension of Sphinx: pages are run, and their output is put in.

The files that a page makes are in build/docs/pages/NAME, notebooks of tutorials among them.
"""

import html
import re
import shutil
from pathlib import Path

import nbformat
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from docs.site.pages import LANGUAGES, PAGES, PICTURE, ROOT, VIEWER, Page, run

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


def write_notebook(page: Page, folder: Path) -> Path:
    """Write NAME.ipynb into the folder."""
    made = notebook(page)
    nbformat.validate(made)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{page.name}.ipynb"
    path.write_text(nbformat.writes(made), encoding="utf-8")
    return path


MADE = ROOT / "build" / "docs" / "pages"
NOTEBOOK = re.compile(r"^<!-- notebook -->$", re.MULTILINE)
# Files outside docs/; the site has a page that includes each.
ELSEWHERE = {
    "scenes/README": "scenes", "config/README": "configuration", "benchmarks/README": "benchmarks",
    "README": "index", "CONTRIBUTING": "architecture",
}  # fmt: skip
OUTSIDE = re.compile(rf"\((?:\.\./)+({'|'.join(ELSEWHERE)})\.md(?:#[\w-]+)?\)")
NAMES = {path.removesuffix(".md"): name for name, path in PAGES.items()}


def setup(app) -> dict[str, bool]:
    app.connect("env-get-outdated", outdated)
    app.connect("source-read", read)
    app.connect("build-finished", copy_viewers)
    return {"parallel_read_safe": False, "parallel_write_safe": True}


def outdated(app, env, added, changed, removed) -> list[str]:
    """Pages that were run before the library changed: Sphinx reads, and so runs, them again."""
    newest = max(file.stat().st_mtime for file in (ROOT / "lfcore").rglob("*.*"))
    return [page for page in NAMES if env.all_docs.get(page, 0) / 1e6 < newest]


def read(app, document: str, source: list[str]) -> None:
    """Sphinx's event ``source-read``: mend links, and put in the output of a page that is run."""
    source[0] = OUTSIDE.sub(lambda found: f"(/{ELSEWHERE[found[1]]}.md)", source[0])
    if document in NAMES:
        source[0] = finished(NAMES[document], depth=document.count("/"))


def finished(name: str, depth: int) -> str:
    """The page with its blocks' output and pictures; ``depth`` is of its folder below docs/."""
    page, up, folder = Page.read(name), "../" * (depth + 1), MADE / name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    text = page.text
    for block, printed in reversed(list(zip(page.blocks, run(page, folder), strict=True))):
        text = text[: block.end] + _after(printed) + text[block.end :]
    place = f"{up}{folder.relative_to(ROOT).as_posix()}"
    figure = rf"\n```{{figure}} {place}/\1\n:alt: \2\n:figclass: made\n\n\2\n```\n"
    text = PICTURE.sub(figure, text)
    text = VIEWER.sub(lambda found: _frame(name, depth, *found.groups()), text)
    if NOTEBOOK.search(text):
        file = write_notebook(page, MADE.parent / "notebooks")
        link = f"{up}{file.relative_to(ROOT).as_posix()}"
        text = NOTEBOOK.sub(f"This page as a notebook: {{download}}`{file.name} <{link}>`.", text)
    return text


def _after(printed: str) -> str:
    # Of a line of progress, the last state.
    printed = re.sub(r"^.*\r", "", printed.strip("\n"), flags=re.MULTILINE)
    return f"\n\n```{{code-block}} text\n:class: printed\n\n{printed}\n```\n" if printed else ""


def _frame(name: str, depth: int, file: str, words: str) -> str:
    address, words = f"{'../' * depth}viewers/{name}/{file}", html.escape(words)
    return (
        f"\n```{{raw}} html\n<iframe class='viewer' loading='lazy' src='{address}' title='{words}'>"
        f"</iframe>\n<p><a href='{address}'>{words}, on a page of its own</a></p>\n```\n"
    )


def copy_viewers(app, error: Exception | None) -> None:
    """Sphinx's event ``build-finished``: viewers are beside the site's pages."""
    for name in () if error else PAGES:
        for file, _ in VIEWER.findall(Page.read(name).text):
            there = Path(app.outdir) / "viewers" / name
            there.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(MADE / name / file, there / file)
