"""The harness itself: defects that are planted are found, each as what it is.

And a short form of `make fuzz`: what was found once, the seeds, and some new inputs of each kind.
"""

import ctypes
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from lfcore import LfcoreError
from lfcore.cli import parser
from robustness.children import Limits, judged
from robustness.fuzz import CORPUS, Bench, fuzz, kept, table
from robustness.inputs import damaged_bytes, damaged_json, damaged_yaml, extreme_yaml
from robustness.outcome import ROOT, Outcome, SilentlyWrong, judge_message, outcome_of
from robustness.targets import Target
from robustness.targets.commands import COMMANDS

LIMITS = Limits(cpu=0.3, wall=60, memory=256 << 20)


def recurse(depth=0):
    return recurse(depth + 1)


def spin():
    while True:
        pass


def refuse(text):
    raise LfcoreError(text, file="input.txt")


def lie():
    raise SilentlyWrong("two and two are five")


PLANTED = {
    "ok": (lambda: None, "ok"),
    "refuse": (lambda: refuse("no good"), "refused"),
    "nameless": (lambda: (_ for _ in ()).throw(LfcoreError("no good")), "message"),
    "raise": (lambda: {}["key"], "traceback"),
    "exit": (lambda: exit(3), "traceback"),
    "recursion": (recurse, "traceback"),
    "memory": (lambda: bytearray(1 << 30), "memory"),
    "wrong": (lie, "silent wrong"),
    "segfault": (lambda: ctypes.string_at(0), "crash"),  # a driver may swallow a sent signal
    "abort": (os.abort, "crash"),
    "status": (lambda: os._exit(7), "crash"),
    "busy": (spin, "time"),
}


def judge(data: bytes, folder: Path) -> Outcome:
    return outcome_of(PLANTED[data.decode()][0], names="input.txt")


@pytest.fixture
def planted():
    """A target whose inputs are the names of what is planted."""
    names = [name.encode() for name in PLANTED]
    return Target(
        "planted", lambda folder: names, st.sampled_from, judge, limits=LIMITS, takes_seeds=False
    )


def test_each_planted_defect_is_found_and_the_next_input_runs(tmp_path):
    names = list(PLANTED)
    outcomes = judged(names, lambda name: judge(name.encode(), tmp_path), LIMITS, tmp_path / "log")
    assert [outcome.kind for outcome in outcomes] == [kind for _, kind in PLANTED.values()]


def test_a_child_that_waits_for_ever_is_found(tmp_path):
    def one(index: int) -> Outcome:
        return outcome_of(lambda: time.sleep(60 * index), names=None)

    outcomes = judged([0, 1], one, Limits(wall=2.0), tmp_path / "log")
    assert [outcome.kind for outcome in outcomes] == ["ok", "hang"]


def test_a_mistake_of_the_judge_is_none_of_the_input(tmp_path):
    (outcome,) = judged([0], lambda number: 1 / number, LIMITS, tmp_path / "log")
    assert outcome.kind == "harness" and outcome.is_finding


def test_the_table_counts_what_came(planted, tmp_path):
    bench = Bench(planted, tmp_path)
    fuzz([bench], seed=1, seconds=0)
    assert bench.counts == {"ok": 1, "refused": 1, "finding": len(PLANTED) - 2}
    counts = [len(PLANTED), 1, 1, len(PLANTED) - 2]
    assert table([bench]).loc["planted"].tolist() == counts


@pytest.mark.parametrize("text", ["", "two\nlines input.txt", "\x1b[31minput.txt", "x" * 3000])
def test_what_is_no_message(text):
    assert judge_message(text, "input.txt").is_finding


def test_an_error_is_one_printable_line_of_bearable_length():
    error = LfcoreError("a\nb\x1b[2J\ud800" + "x" * 10_000, file="input.txt", remedy="Say less")
    assert judge_message(str(error), "input.txt").kind == "refused"
    assert str(error).endswith("Say less.")


def test_a_finding_is_made_shorter(tmp_path):
    def judge(data: bytes, folder: Path) -> Outcome:
        found = b"needle" in data and b"pin" in data
        return Outcome("traceback", "both") if found else Outcome("ok")

    hay = [b"hay" * 9 + b"needle" + b"hay" * 9 + b"pin", b"hay"]
    bench = Bench(Target("hay", lambda folder: hay, damaged_bytes, judge), tmp_path)
    bench.explore(1, 200)
    ((_, shortest),) = bench.findings.values()
    assert len(shortest) < len(hay[0])


@pytest.mark.parametrize("damaged", [damaged_yaml, damaged_json, extreme_yaml])
def test_a_damaged_tree_is_mostly_a_tree(damaged):
    inputs = damaged([b'{"a": [1, 2.5, "b"], "c": {"d": null}}'])
    trees = []

    @given(inputs)
    def read(data):
        trees.append(data)

    read()
    assert len(set(trees)) > 50
    readable = [data for data in trees if reads(data)]
    assert len(readable) > len(trees) / 2


def reads(data: bytes) -> bool:
    try:
        yaml.load(data, yaml.SafeLoader)  # libyaml ends the process at deep trees
    except (yaml.YAMLError, ValueError, RecursionError, TypeError):
        return False
    return True


EACH = 15


@pytest.mark.slow
def test_nothing_that_was_found_comes_back_and_nothing_new_in_a_few_hundred_inputs():
    # A process of its own: children must not inherit this one's OpenCL threads.
    done = subprocess.run(
        [sys.executable, "-m", "robustness.fuzz", "--seconds", "0", "--each", str(EACH)],
        cwd=ROOT, capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-2000:]
    row = next(line for line in done.stdout.splitlines() if line.startswith("| all "))
    inputs, taken, refused, findings = map(int, row.split("|")[2:6])
    assert findings == 0 and taken > 0 and refused > 0
    assert inputs >= sum(len(kept(folder.name)) for folder in CORPUS.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("line", COMMANDS)
def test_the_command_lines_that_are_damaged_are_whole(line):
    parser(line.split()).parse_args(line.split())
