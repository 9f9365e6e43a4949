"""The manual's pages run, and its links lead somewhere."""

import os
import re
import sys
from pathlib import Path

import pytest

import lfcore
from docs.conf import ELSEWHERE
from docs.site import reference
from lfcore.cli import COMMANDS
from robustness.outcome import ROOT

DOCS = ROOT / "docs"
RUN_PAGES = [
    path.relative_to(DOCS).as_posix() for path in sorted(DOCS.rglob("*.md"))
    if "\n<!-- run" in path.read_text(encoding="utf-8")
]  # fmt: skip


@pytest.fixture
def pages(monkeypatch):
    """The module that reads pages; their commands are those of this environment."""
    pytest.importorskip("nbclient", reason="pip install -e '.[docs]'")
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    return pytest.importorskip("docs.site.pages", reason="pip install -e '.[docs]'")


def executed(pages, text, folder):
    """The page's notebook after a run at a small size."""
    from nbclient import NotebookClient

    book = pages.read(text, folder, small=True)
    NotebookClient(book, timeout=300, kernel_name="python3").execute()
    return book


@pytest.mark.slow
@pytest.mark.parametrize("name", RUN_PAGES)
def test_the_page_runs(pages, name, tmp_path):
    """Every command and every line of Python of a page, at a small size; pictures are shown."""
    text = (DOCS / name).read_text(encoding="utf-8")
    book = executed(pages, text, tmp_path)
    kinds = [kind for cell in book.cells for one in cell.get("outputs", [])
             for kind in one.get("data", {})]  # fmt: skip
    assert kinds.count("image/png") >= text.count("<!-- picture: ")
    assert kinds.count("text/html") >= text.count("<!-- viewer: ")


@pytest.mark.slow
@pytest.mark.parametrize(
    "block",
    ["```bash\nfalse\ntrue\n```", "```bash\nlfcore info nothing.mkv\n```", "```python\n1 / 0\n```"],
)
def test_a_block_that_fails_fails_the_page(pages, tmp_path, block):
    from nbclient.exceptions import CellExecutionError

    with pytest.raises(CellExecutionError):
        executed(pages, f"# Broken\n\n<!-- run -->\n\n{block}\n", tmp_path)


def test_commands_are_shown_as_they_are_typed(pages, tmp_path):
    text = "# A page\n\n<!-- run; small: 256 = 16 -->\n\n```bash\nlfcore info a --pixels 256\n```\n"
    title, start, shown, command = pages.read(text, tmp_path, small=True).cells
    assert title.source == "# A page" and "remove-cell" in start.metadata["tags"]
    assert shown.source == "```bash\nlfcore info a --pixels 16\n```"
    assert "'lfcore info a --pixels 16'" in command.source
    assert "remove-input" in command.metadata["tags"]
    assert (tmp_path / "a-page" / "scenes" / "bike" / "scene.yaml").exists()


def test_every_public_name_and_command_is_readable_in_the_repository():
    """The pages are as ``python -m docs.site.reference`` makes them."""
    pages = reference.pages()
    for path, text in pages.items():
        assert path.read_text(encoding="utf-8") == text, "run python -m docs.site.reference"
        assert "eval-rst" not in text
    api, commands = pages.values()
    names = " ".join(re.findall(r"<!-- names: (.*?) -->", api, re.DOTALL)).split()
    assert sorted(names) == sorted(lfcore.__all__)
    assert "- `render(scene, focus_m=None, f_number=None, *," in api
    assert all(f"### lfcore {name}\n" in commands for name in COMMANDS)
    assert "| `--pixels M` | M x M pixels" in commands
    site = reference.with_docstrings(api)
    assert ".. autofunction:: lfcore.render\n" in site and "- `render(" not in site


def test_links_that_lead_out_of_the_manual_lead_to_its_pages_or_to_files():
    """What a page of docs/ links to in the tree is there, and if it is Markdown the site has it."""
    for path in DOCS.rglob("*.md"):
        for link in re.findall(r"\]\((?!https?:|#)([^)#\s]+)", path.read_text(encoding="utf-8")):
            target = (path.parent / link).resolve()
            assert target.exists(), f"{path}: {link}"
            inside = target.is_relative_to(DOCS)
            outside = target.relative_to(ROOT).with_suffix("").as_posix() in ELSEWHERE
            assert target.suffix != ".md" or inside or outside, f"{path}: {link}"


def test_files_and_names_of_the_architecture_are_in_the_tree():
    """The page names files by the end of their path, and names of the kernels or of the library."""
    files = [p for f in ("lfcore", "workflow", "robustness", "tests", "scenes", "docs")
             for p in (ROOT / f).rglob("*.*")]  # fmt: skip
    paths = [f"/{path.relative_to(ROOT).as_posix()}" for path in files]
    text = (DOCS / "architecture.md").read_text(encoding="utf-8")
    spans = {span for span in re.findall(r"`([^`\n]+)`", text) if "{" not in span}
    named = {span for span in spans if re.fullmatch(r"[\w/]+\.(py|cl|js|yaml|md|json)", span)}
    missing = [name for name in named if not any(path.endswith(f"/{name}") for path in paths)]
    assert [name for name in missing if "NAME" not in name] == []
    words = re.compile(r"\w+")
    code = [
        path for path in files if path.suffix in (".py", ".pyi", ".cl") and "lfcore" in path.parts
    ]
    known = {word for path in code for word in words.findall(path.read_text(encoding="utf-8"))}
    names = {
        part
        for span in spans - named
        if re.fullmatch(r"[A-Za-z]\w*(\.\w+)*", span)
        for part in span.split(".")
    }
    assert {name for name in names if name not in known} == set()
