"""The fault injector, and a short form of `python -m robustness.faults`."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest

from robustness import disks, faults, kills
from robustness.disks import Writer

pytestmark = pytest.mark.slow

# Takes half a second; what a kill leaves behind is in the next run's result, or is not.
PROGRAM = """
import pathlib, time
left = pathlib.Path("left")
found = left.exists()
left.touch()
time.sleep(0.5)
pathlib.Path("out/made").write_text(str(found and {careless}))
left.unlink()
"""


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    home = tmp_path_factory.mktemp("disks")
    if reason := disks.can_mount(home):
        pytest.skip(f"no small disk can be mounted here: {reason}")
    return home


def half(path: Path) -> None:
    """Does not hear what the system says, as a library in C may not."""
    try:
        path.write_bytes(b"0123456789abcdef" * 1024)
    except OSError:
        pass


def untidy(path: Path) -> None:
    """Leaves its draft."""
    draft = path.with_name(".draft")
    draft.write_bytes(b"0123456789abcdef" * 1024)
    draft.rename(path)


@pytest.mark.parametrize("write", [half, untidy])
def test_a_writer_that_leaves_half_a_file_is_found(home, write):
    outcomes = disks.fill(Writer("bad", "bad.bin", write), home)
    assert {outcome.kind for _, outcome in outcomes} == {"silent wrong", "ok"}


@pytest.mark.parametrize("careless", [False, True])
def test_what_a_kill_changes_is_found(tmp_path, careless):
    program = tmp_path / "program.py"
    program.write_text(PROGRAM.format(careless=careless))
    job = kills.Job("program", (sys.executable, str(program)), ("out/*",))
    killed, tally, draw = kills.Killed(job, tmp_path / "run"), kills.Tally(), Random(3)
    while tally.kills < 2:
        # Late enough that the program has begun.
        killed.disturb(draw, "KILL", tally)
        (tmp_path / "run" / "left").unlink(missing_ok=True)
    assert tally.went_on == 2
    if careless:
        assert tally.identical < 2 and "other results" in tally.findings[0]
    else:
        assert tally.identical == 2 and not tally.findings


def test_a_run_that_hangs_is_ended(monkeypatch):
    monkeypatch.setattr(kills, "LONGEST", 1.0)
    program = "import time; time.sleep(60)"
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, start_new_session=True
    )
    assert kills.until_end(process) is None and process.returncode < 0


@pytest.mark.slow
def test_a_render_that_is_killed_goes_on_and_is_identical(tmp_path):
    (render,) = (job for job in kills.jobs() if job.name == "render")
    small = replace(render, command=(*render.command[:-4], "--pixels", "16", "--views", "4"))
    killed, tally, draw = kills.Killed(small, tmp_path / "run"), kills.Tally(), Random(5)
    for way in ("KILL", "TERM"):
        killed.disturb(draw, way, tally)
    assert not tally.findings and tally.identical == tally.kills


def test_surroundings_that_are_not_as_they_should(tmp_path):
    names = ("home is /dev/null", "standard error is closed", "the output is below a file",
             "threads: abc")  # fmt: skip
    results = dict(faults.try_all(tmp_path / "folder", names))
    assert results == dict.fromkeys(names, "")
