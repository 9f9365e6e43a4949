"""The manual: its pages run, its links lead somewhere, and nothing public is missing."""

import re

import nbformat
import pytest

import lfcore
from docs.site import command_line, extension
from docs.site.extension import ELSEWHERE
from docs.site.pages import PAGES, ROOT, Block, Page, PageError, run
from lfcore.cli import COMMANDS

DOCS = ROOT / "docs"


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_the_page_runs(name, tmp_path):
    """Every command and every line of Python of a tutorial, at a small size."""
    page = Page.read(name)
    assert page.blocks
    for whole in page.small:
        assert any(whole in block.code for block in page.blocks), f"{whole!r} is in no block"
    run(page, tmp_path, small=True)
    for file in re.findall(r"<!-- (?:picture|viewer): (\S+) \|", page.text):
        assert (tmp_path / file).stat().st_size > 0


@pytest.mark.parametrize(
    ("language", "code"),
    [("bash", "false\n"), ("bash", "lfcore info nothing.mkv\n"), ("python", "assert False\n")],
)
def test_a_block_that_fails_fails_the_page(tmp_path, language, code):
    with pytest.raises(PageError, match="broken"):
        run(Page("broken", "", [Block(language, code, 0)]), tmp_path)


def test_every_command_is_in_the_manual_and_examples_keep_their_lines(capsys):
    with pytest.raises(SystemExit):
        command_line.parser().parse_args(["refocus", "--help"])
    said = capsys.readouterr().out
    assert "--focus" in said and "::\n\n    examples:\n      lfcore refocus" in said
    words = command_line.parser().format_help().split()
    assert set(COMMANDS) <= set(words)


def test_every_public_name_is_on_the_page():
    text = (DOCS / "api.md").read_text()
    said = re.findall(r"auto(?:function|class|exception):: lfcore\.(\w+)", text)
    assert sorted(said) == sorted(lfcore.__all__)


@pytest.mark.parametrize("name", ["first-picture", "stanford"])
def test_a_notebook_has_the_pages_code(name, tmp_path):
    page = Page.read(name)
    assert "<!-- notebook -->" in page.text
    made = nbformat.read(extension.write_notebook(page, tmp_path), 4)
    nbformat.validate(made)
    cells = [cell.source for cell in made.cells if cell.cell_type == "code"]
    for block in page.blocks:
        assert block.code.strip() in [cell.removeprefix("%%bash\n") for cell in cells]
    assert not any("<!--" in cell.source for cell in made.cells)


def test_links_that_lead_out_of_the_manual_lead_to_its_pages_or_to_files():
    """What a page of docs/ links to in the tree is there, and if it is Markdown the site has it."""
    for path in DOCS.rglob("*.md"):
        for link in re.findall(r"\]\((?!https?:|#)([^)#\s]+)", path.read_text(encoding="utf-8")):
            target = (path.parent / link).resolve()
            assert target.exists(), f"{path}: {link}"
            inside = target.is_relative_to(DOCS)
            outside = target.relative_to(ROOT).with_suffix("").as_posix() in ELSEWHERE
            assert target.suffix != ".md" or inside or outside, f"{path}: {link}"
