"""A short form of `make fuzz`: what was found once, the seeds, and some new inputs of each kind."""

import subprocess
import sys

import pytest

from lfcore.cli import parser
from robustness import fuzz
from robustness.outcome import ROOT
from robustness.targets.commands import COMMANDS

pytestmark = pytest.mark.slow

EACH = 15


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
    assert inputs >= sum(len(fuzz.kept(folder.name)) for folder in fuzz.CORPUS.iterdir())


@pytest.mark.parametrize("line", COMMANDS)
def test_the_command_lines_that_are_damaged_are_whole(line):
    parser(line.split()).parse_args(line.split())
