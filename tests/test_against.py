"""Two commits of the tracer in turn."""

from __future__ import annotations

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


def test_a_commit_and_this_tree_take_turns(revision, tmp_path, monkeypatch, capsys):
    out = tmp_path / "against.csv"
    small = ["--angular", "4", "--size", "32", "--mrays", "0.01", "--rounds", "1"]
    words = ["against", revision, "--scenes", "bike", *small, "--out", str(out)]
    monkeypatch.setattr("sys.argv", words)
    against.main()
    rows = list(csv.DictReader(out.open()))
    assert [(row["work"], row["scene"]) for row in rows] == [("frames", "bike"), ("hits", "bike")]
    assert all(0.01 < float(row["N = 4"]) < 100 for row in rows)
    listed = subprocess.run(
        ["git", "-C", str(against.ROOT), "worktree", "list"], capture_output=True, text=True
    ).stdout
    assert listed.count(revision[:7]) == 1  # the other checkout is gone
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


def test_the_best_quarter_counts_and_the_first_run_does_not():
    programs = [Slow(9, 3, 1, 5, 4), Slow(9, 2, 8, 6, 7)]
    assert against.in_turn(programs, {}, 4) == [1, 2]
