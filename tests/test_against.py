"""Two commits of the tracer in turn."""

import csv
import shutil
import subprocess

import pytest

from benchmarks import against
from lfcore.errors import LfcoreError


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
    words = ["against", revision, "--scenes", "bike", *small, "--out", str(out)]
    monkeypatch.setattr("sys.argv", words)
    against.main()
    rows = list(csv.DictReader(out.open()))
    assert [(row["work"], row["scene"]) for row in rows] == [
        (work, "bike") for work in against.WORK
    ]
    assert worktrees() == before  # the other checkout is gone
    assert "hits, bike, N = 4" in capsys.readouterr().err


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
    (row,) = against.rows(programs, "core-avx2", options)
    assert row == {"work": "hits", "held_to": "core-avx2", "scene": "bike", "N = 4": "0.50"}
