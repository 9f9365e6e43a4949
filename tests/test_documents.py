"""The manual's pages run and its links lead somewhere; published numbers are their results'."""

import re
import shutil
import subprocess

import nbformat
import numpy as np
import pandas as pd
import pytest

import lfcore
from benchmarks import against, publish, sceptic
from benchmarks.peers.method import SkippedError
from benchmarks.peers.mitsuba_lens import check_plain
from benchmarks.results import with_kept
from docs.site import command_line, extension
from docs.site.extension import ELSEWHERE
from docs.site.pages import PAGES, ROOT, Block, Page, PageError, run
from lfcore import LfcoreError, SensorPlane
from lfcore.cli import COMMANDS
from lfcore.opencl.program_cache import cache_home
from lfcore.rendering.prepared import open_tracer
from tests.plain_scenes import scene, wall

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


@pytest.fixture
def revision():
    """This commit's name; a tree without its history has none."""
    git = ["git", "-C", str(against.ROOT), "rev-parse", "HEAD"]
    found = shutil.which("git") and subprocess.run(git, capture_output=True, text=True)
    if not found or found.returncode:
        pytest.skip("no git, or no history: there is no other commit to compare with")
    return found.stdout.strip()


def worktrees():
    """The folders that git counts as checkouts of this repository."""
    git = ["git", "-C", str(against.ROOT), "worktree", "list", "--porcelain"]
    listed = subprocess.run(git, capture_output=True, text=True, check=True).stdout
    return {line for line in listed.splitlines() if line.startswith("worktree ")}


def test_a_commit_and_this_tree_take_turns(revision, tmp_path, monkeypatch, capsys):
    out, before = tmp_path / "against.csv", worktrees()
    small = ["--views", "4", "--pixels", "32", "--mrays", "0.01", "--rounds", "1"]
    words = ["against", revision, "--scenes", "chart", *small, "--out", str(out)]
    monkeypatch.setattr("sys.argv", words)
    own = against.Program  # with the programs that other tests have built
    monkeypatch.setattr(against, "Program", lambda *of: own(*of[:2], cache_home(), *of[3:]))
    against.main()
    _, rows = publish.read_result(out)
    assert list(zip(rows.work, rows.scene, strict=True)) == [
        (work, "chart") for work in against.WORK
    ]
    assert worktrees() == before  # the other checkout is gone
    assert "hits, chart, N = 4" in capsys.readouterr().err


def test_an_unknown_commit_is_named():
    with pytest.raises(LfcoreError, match="git has no 'no-such-commit'"):
        with against.checkout("no-such-commit"):
            pass


class Slow:
    """A program whose runs take as long as it is told."""

    def __init__(self, *seconds: float):
        self.seconds = list(seconds)

    def ask(self, case):
        return self.seconds.pop(0)


def test_the_ratio_is_of_the_best_quarter_without_the_first_run():
    programs = [Slow(9, 3, 1, 5, 4), Slow(9, 2, 8, 6, 7)]
    words = ["abc", "--scenes", "bike", "--views", "4", "--work", "hits", "--rounds", "4"]
    options = against.parse([*words, "--out", "x.csv"])
    (row,) = against.rows(programs, options)
    assert row == {"work": "hits", "scene": "bike", "N = 4": "0.50"}


PROVENANCE = {"command": "make x", "commit": "abc", "processor": "a machine", "date": "2026-01-02"}
PLACE = "<!-- published: some: N; s where N in 2 3 4 and more in 0 -->"
TEXT = f"Before.\n{PLACE}\nold\n<!-- end of some -->\nAfter.\n"


@pytest.fixture
def results(tmp_path, monkeypatch):
    monkeypatch.setattr(publish, "RESULTS", tmp_path)
    rows = pd.DataFrame({"N": [2, 3, 4], "s": ["1.50", "2.0", "inf"], "more": [0, 1, 0]})
    publish.write_result(tmp_path / "some.csv", PROVENANCE | {"note": "Hot."}, rows)
    return tmp_path


def test_a_place_is_filled_with_its_rows_and_columns(results):
    made = publish.published(TEXT)
    assert "| N | s |\n|---|---|\n| 2 | 1.50 |\n| 4 | inf |\n" in made
    assert "Made by `make x`: commit abc, 2026-01-02, a machine. Hot." in made
    assert made.startswith("Before.\n") and made.endswith("After.\n") and "old" not in made
    assert publish.published(made) == made


def test_what_cannot_be_published(results):
    with pytest.raises(publish.PublishError, match="no column 'absent'"):
        publish.published(TEXT.replace("N; s", "N; absent"))
    (results / "some.csv").write_text("# command: x\nN\n1\n")
    with pytest.raises(publish.PublishError, match="does not say its commit, processor, date"):
        publish.published(TEXT)


def test_a_part_of_a_result_is_made_anew(results):
    found = with_kept(pd.DataFrame({"N": ["3"], "s": ["9"]}), results / "some.csv", "N")
    assert found[["N", "s"]].values.tolist() == [["3", "9"], ["2", "1.50"], ["4", "inf"]]
    assert list(found.columns) == ["N", "s", "commit", "more"] and found["more"].iloc[0] == ""


def test_errors_that_the_truth_can_judge_are_published(tmp_path):
    rows = [  # panel, method, setting, seconds, dB, note
        ("on the fly", "nearest pixel", "512 x 1", 8.0, 30, None),
        ("on the fly", "by depth", "4 x 2", 0.5, 44, None),
        ("on the fly", "by depth", "8 x 3", 1.0, 58, "not judged"),
        ("on the fly", "nearest pixel", "16 x 1", 0.1, 29, None),
        ("from a file", "by depth", "4 x 2", 0.1, 43, None),
    ]
    names = ["panel", "method", "setting", "seconds", "psnr_true_db", "note"]
    table = pd.DataFrame(rows, columns=names).assign(scene="a", f_number=1.0, rays_per_pixel=64)
    table.to_csv(tmp_path / "work_precision.csv", index=False)
    found = publish.true_picture(tmp_path)
    assert list(found.lattice) == ["512 x 1", "4 x 2"]
    assert list(found["worst dB"]) == ["30.0", "44.0"]
    assert list(found["of N = 512"]) == ["1/1", "1/16"]


def test_a_run_is_taken_with_its_commit(results, tmp_path, monkeypatch):
    monkeypatch.setattr(publish, "documents", dict)
    folder = tmp_path / "tables"
    folder.mkdir()
    key = {"scene": ["bike"], "N": [16], "seconds": [0.123]}
    for name, more in (
        ("table_7_1", {"psnr_db": [43.26], "psnr_true_db": [32.81], "ssim": [0.98765]}),
        ("table_7_2", {"ratio_float32": [148.6]}),
        ("table_7_3", {"psnr_db": [float("inf")], "psnr_true_db": [32.8], "ssim": [1.0]}),
    ):
        pd.DataFrame(key | more).to_csv(folder / f"{name}.csv", index=False)
    assert publish.main(["--check", "--take", "some", "--command", "make tables", str(folder)]) == 0
    run, rows = publish.read_result(results / "some.csv")
    assert run["command"] == "make tables" and len(run["commit"]) >= 7
    assert rows.iloc[0].tolist() == [
        "bike", "16", "0.1", "43.3", "32.8", "0.9877", "0.1", "149", "0.1", "inf", "32.8", "1.0000",
    ]  # fmt: skip


def test_peers_stand_beside_the_better_of_their_ways(tmp_path):
    rows = [("lfcore", 90.0), ("embree, 4 x 4 pixels", 30.0), ("embree, 4 x 4 lens samples", 20.0)]
    table = pd.DataFrame(rows, columns=["method", "mrays_per_core_second"])
    table.assign(scene="bike", N=16).to_csv(tmp_path / "t.csv", index=False)
    (row,) = publish.peers(tmp_path / "t.csv").to_dict("records")
    assert (row[publish.HITS], row["Embree 3"], row["times Embree"]) == ("90", "30", "3")


def test_a_scene_that_a_peer_cannot_shade_is_left_out_by_name():
    cut = scene(wall(3.0), colours=np.ones((len(wall(3.0)), 3, 3), np.float32))
    with pytest.raises(SkippedError, match="colours at corners"):
        check_plain(cut)


@pytest.mark.kernels
def test_rows_have_what_each_setting_made(tmp_path):
    """Seconds are of the best of the runs, dB of each plane; a figure and crops are made of it."""
    shown = scene(wall(3.0))
    tracer = open_tracer(shown)
    planes = [SensorPlane(focus, shown.camera.f_number) for focus in (2.0, 3.0, 5.0)]
    points = list(sceptic.ours(tracer, planes, 64, 4))
    assert {point.rays for point in points if np.isfinite(point.rays)} == {1, 4}
    fixed = [point for point in points if np.isfinite(point.rays)]
    truths, kept = fixed[-1].make()[0], {}
    rows = list(sceptic.rows_of(shown, fixed, truths, 64, 1, kept))
    assert [row["setting"] for row in rows] == [point.setting for point in fixed]
    assert all(float(row["core s"]) > 0 for row in rows)
    assert float(rows[-1]["middle dB"]) > 60
    kept[shown.name, 64, "true", ""] = truths[1]
    table = sceptic.pd.DataFrame(rows)
    sceptic.figure(table, tmp_path / "figure.png")
    sceptic.crops(table, kept, tmp_path)
    assert len(list(tmp_path.glob("*.png"))) == 2
