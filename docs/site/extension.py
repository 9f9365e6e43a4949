"""The manual's own extension of Sphinx: pages are run, and what is generated is put in.

What a page made lies in build/docs/pages/NAME until the page or the library changes.
"""

from __future__ import annotations

import hashlib
import html
import json
import os
import re
import shutil
from pathlib import Path

from docs.site import command_line, docstrings, notebooks
from docs.site.pages import PAGES, ROOT, Page, run
from lfcore.workflow.sources import digest

MADE = ROOT / "build" / "docs" / "pages"
PICTURE = re.compile(r"^<!-- picture: (\S+) \| (.*?) -->$", re.MULTILINE)
VIEWER = re.compile(r"^<!-- viewer: (\S+) \| (.*?) -->$", re.MULTILINE)
NOTEBOOK = re.compile(r"^<!-- notebook -->$", re.MULTILINE)
# Read where they stand in the tree; the site has a page that includes each.
ELSEWHERE = {
    "scenes/README": "scenes", "config/README": "configuration", "benchmarks/README": "benchmarks",
    "README": "index", "CONTRIBUTING": "architecture",
}  # fmt: skip
OUTSIDE = re.compile(rf"\((?:\.\./)+({'|'.join(ELSEWHERE)})\.md(?:#[\w-]+)?\)")
OF_FILES = {path: name for name, path in PAGES.items()}


def setup(app) -> dict[str, bool]:
    app.connect("source-read", read)
    app.connect("autodoc-process-docstring", docstrings.process)
    app.connect("autodoc-process-signature", docstrings.signature)
    app.connect("build-finished", copy_viewers)
    return {"parallel_read_safe": False, "parallel_write_safe": True}


def read(app, document: str, source: list[str]) -> None:
    """Sphinx's event ``source-read``: put in what is generated."""
    source[0] = OUTSIDE.sub(lambda found: f"(/{ELSEWHERE[found[1]]}.md)", source[0])
    if command_line.MARK in source[0]:
        source[0] = source[0].replace(command_line.MARK, command_line.markdown())
    name = OF_FILES.get(f"{document}.md")
    if name:
        source[0] = finished(name, depth=document.count("/"))


def finished(name: str, depth: int) -> str:
    """The page with what its blocks printed and made; ``depth`` is of its folder below docs/."""
    page, up = Page.read(name), "../" * (depth + 1)
    folder, printed = made(page)
    text = page.text
    for block, said in reversed(list(zip(page.blocks, printed, strict=True))):
        text = text[: block.end] + _after(block.skipped, said) + text[block.end :]
    place = f"{up}{folder.relative_to(ROOT).as_posix()}"
    text = PICTURE.sub(lambda found: _figure(place, *found.groups()), text)
    text = VIEWER.sub(lambda found: _frame(name, depth, *found.groups()), text)
    if NOTEBOOK.search(text):
        file = notebooks.write(page, MADE.parent / "notebooks")
        link = f"{up}{file.relative_to(ROOT).as_posix()}"
        text = NOTEBOOK.sub(f"This page as a notebook: {{download}}`{file.name} <{link}>`.", text)
    return text


def _after(skipped: str, said: str) -> str:
    if skipped:
        return f"\n\n*Not run when this page was built: {skipped}.*\n"
    # A line of progress is what its last state was.
    said = re.sub(r"^.*\r", "", said.strip("\n"), flags=re.MULTILINE)
    if not said:
        return ""
    return f"\n\n```{{code-block}} text\n:class: printed\n\n{said}\n```\n"


def _figure(place: str, file: str, words: str) -> str:
    return f"\n```{{figure}} {place}/{file}\n:alt: {words}\n:figclass: made\n\n{words}\n```\n"


def _frame(name: str, depth: int, file: str, words: str) -> str:
    address, words = f"{'../' * depth}viewers/{name}/{file}", html.escape(words)
    return (
        f"\n```{{raw}} html\n<iframe class='viewer' loading='lazy' src='{address}' title='{words}'>"
        f"</iframe>\n<p><a href='{address}'>{words}, on a page of its own</a></p>\n```\n"
    )


def made(page: Page) -> tuple[Path, list[str]]:
    """The folder of what a page made, and what its blocks printed; run where need be."""
    state = hashlib.sha256(f"{digest('.')}{page.text}".encode()).hexdigest()
    folder = MADE / page.name
    record = folder / "printed.json"
    if record.is_file():
        found = json.loads(record.read_text(encoding="utf-8"))
        if found["state"] == state:
            return folder, found["printed"]
    shutil.rmtree(folder, ignore_errors=True)
    # Whole or not at all: a page that failed is run again.
    draft = folder.with_name(f"{page.name}.draft-{os.getpid()}")
    draft.mkdir(parents=True)
    try:
        printed = run(page, draft)
        (draft / "printed.json").write_text(json.dumps({"state": state, "printed": printed}))
        draft.rename(folder)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    return folder, printed


def copy_viewers(app, error: Exception | None) -> None:
    """Sphinx's event ``build-finished``: pages that are shown in frames lie beside the site's."""
    if error:
        return
    for name in PAGES:
        page = Page.read(name)
        for file, _ in VIEWER.findall(page.text):
            there = Path(app.outdir) / "viewers" / name
            there.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(MADE / name / file, there / file)
