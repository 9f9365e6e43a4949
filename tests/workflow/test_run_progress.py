"""How far a run is: told from what Snakemake's logger says and from the jobs' own logs."""

from __future__ import annotations

import csv
import logging
import os
import pty
import re
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace

import pytest

from lfcore.workflow import job, progress
from lfcore.workflow.costs import Cost
from lfcore.workflow.forecast import START_SECONDS
from lfcore.workflow.progress import Job, Progress, Stage

ROOT = Path(__file__).resolve().parents[2]
SCENES = ["bike", "N16", "my_scene"]


@pytest.mark.parametrize(
    ("log", "stage"),
    [
        ("logs/trace/bike/N16/0003.log", Stage("trace", "bike", 16, "0003")),
        ("logs/assignment/trace/bike.log", Stage("assignment/trace", "bike")),
        ("logs/truth/my_scene/wide.log", Stage("truth/wide", "my_scene")),
        ("logs/stability.log", Stage("stability")),
    ],
)
def test_a_log_says_what_its_job_is_of(log, stage):
    assert Stage.of_log(log, SCENES) == stage
    assert str(Stage("work_precision", "bike", 64)) == "work precision bike N = 64"


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


def said(event, **more):
    record = logging.LogRecord("snakemake", logging.INFO, "", 0, "", (), None)
    vars(record).update(event=SimpleNamespace(value=event), **more)
    return record


@pytest.fixture
def run(tmp_path):
    """Two tilings of 60 s each, and a sum after both, on two cores."""
    jobs = {}
    for number, rays in ((7, 1_000_000), (8, 3_000_000), (9, 0)):
        after = (7, 8) if not rays else ()
        jobs[number] = Job(
            Cost(60 - START_SECONDS, 100), after=after, rays=rays,
            stage=Stage("trace" if rays else "sum", "bike", 16), share=0.5,
            log=str(tmp_path / f"{number}.log"), kept=[str(tmp_path / f"{number}.out")],
            temporary=[],
        )  # fmt: skip
    clock, took = Clock(), tmp_path / "took.csv"
    made = Progress(jobs, cores=2, pixels=32, pace=1.0, took=took, clock=clock)
    return made, clock, tmp_path


def test_the_line_follows_the_jobs(run):
    made, clock, folder = run
    assert made.line() == "0.0 of 4.0 million rays; 0 of 3 jobs; 2 min left"
    made.emit(said("job_started", jobs=[7, 8]))
    clock.now = 30.0
    (folder / "8.log").write_text("tiles: 1 of 3\ntiles: 2 of 3\n")
    line = made.line()
    assert line.startswith("2.0 of 4.0 million rays; 0 of 3 jobs; ")
    assert line.endswith("now: trace bike N = 16")
    assert made.seconds_left() == pytest.approx(30 + 60)  # 7 has half of its time left, 9 all
    clock.now = 120.0  # 7 should be done, and 8 says that a third is left
    assert made.seconds_left() == pytest.approx(60 + 60)
    clock.now = 30.0
    clock.now = 60.0
    (folder / "7.out").write_bytes(b"12345")
    (folder / "7.log").write_text("tiles: 1 of 1\ntook 58.0 s, 57.5 core s, 123 MiB\n")
    made.emit(said("job_finished", job_id=7))
    made.emit(said("job_finished", job_id=8))
    made.emit(said("progress"))
    made.emit(said("job_finished", job_id=1))  # of a job that is not counted
    assert made.line() == "4.0 of 4.0 million rays; 2 of 3 jobs; 60 s left"
    rows = list(csv.DictReader((folder / "took.csv").open()))
    assert len(rows) == 1  # 8 did not say what it took
    assert (rows[0]["stage"], rows[0]["N"], rows[0]["M"]) == ("trace", "16", "32")
    assert (rows[0]["wall_seconds"], rows[0]["core_seconds"]) == ("60.0", "57.5")
    assert (rows[0]["mib"], rows[0]["kept_bytes"]) == ("123.0", "5")


def test_a_slow_machine_is_noticed_and_remembered(run):
    made, clock, folder = run
    made.emit(said("job_started", jobs=[7, 8]))
    clock.now = 120.0
    for number in (7, 8):
        (folder / f"{number}.log").write_text("took 118.0 s, 57.5 core s, 123 MiB\n")
        made.emit(said("job_finished", job_id=number))
    # 240 s of 120 that were told, and 300 s that count as told.
    assert made.pace_now() == pytest.approx(540 / 420)
    assert made.seconds_left() == pytest.approx(60 * 540 / 420)
    assert progress.pace_before(folder / "took.csv") == pytest.approx(540 / 420)
    assert progress.pace_before(folder / "none.csv") == 1
    (folder / "took.csv").write_text("broken\n1\n")
    assert progress.pace_before(folder / "took.csv") == 1


def test_a_jobs_last_line_is_what_is_read():
    found = progress.USAGE.findall(f"planes: 1 of 1\n{job.usage(12.3)}\n".encode())
    assert len(found) == 1 and found[0][0] == b"12.3" and float(found[0][2]) > 10


SNAKEFILE = f"""
import sys
sys.path.insert(0, {str(ROOT)!r})
from snakemake.exceptions import WorkflowError
from lfcore.errors import SettingsError
from lfcore.workflow import costs, progress
costs.SMALL_JOB = costs.Cost(0.5, 100, float(config["bytes"]))
progress.hush(workflow)

onstart:
    try:
        progress.begin(workflow, progress.known_jobs(workflow.dag, [], 16, {{}}), 16)
    except SettingsError as error:
        raise WorkflowError(str(error)) from None
onsuccess:
    progress.end()
onerror:
    progress.end(log)
rule last:
    input: "a"
    output: "b"
    log: "logs/last.log"
    shell: "test ! -e fail; sleep 1; touch {{output}}; echo 'took 1 s, 0.1 core s, 5 MiB' > {{log}}"
rule first:
    output: "a"
    log: "logs/first.log"
    shell: "echo 'took 0.1 s, 0.1 core s, 5 MiB' > {{log}}; touch {{output}}"
"""


def little_run(folder, number, *more, terminal=None):
    """The little workflow by our start, perhaps on a terminal of which its output is read."""
    (folder / "Snakefile").write_text(SNAKEFILE)
    words = ("-m", "lfcore.workflow.run", "--cores", "1", "--config", f"bytes={number}", *more)
    environment = {
        name: text for name, text in os.environ.items() if not name.startswith("LFCORE_")
    }
    return subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env=environment | {"PYTHONPATH": str(ROOT)},
        stdout=terminal or subprocess.PIPE,
        stderr=terminal or subprocess.STDOUT,
        text=True,
        timeout=120,
    )


@pytest.mark.workflow
def test_a_run_says_what_it_takes_and_that_it_is_done(tmp_path):
    done = little_run(tmp_path, 1e6)
    assert done.returncode == 0, done.stdout
    lines = [line for line in done.stdout.splitlines() if line]
    assert lines[-2].startswith("To be made: 2 jobs. About 2 s on 1 core, 2 MiB of disk")
    assert lines[-1].endswith(": 2 of 2 jobs.") and "rule first" not in done.stdout
    log = next((tmp_path / ".snakemake" / "log").glob("*.log")).read_text()
    assert "rule first" in log and "2 of 2 steps" in log
    stages = [row["stage"] for row in csv.DictReader((tmp_path / progress.TOOK).open())]
    assert stages == ["first", "last"]
    # What is made already counts no more; who asks for Snakemake's own words has them.
    (tmp_path / "b").unlink()
    again = little_run(tmp_path, 1e6, "--verbose").stdout
    assert "To be made: 1 job." in again and "rule last" in again
    assert "Nothing to be done" in little_run(tmp_path, 1e6).stdout


@pytest.mark.workflow
def test_a_run_that_the_disk_cannot_hold_makes_nothing(tmp_path):
    done = little_run(tmp_path, 1e18)
    assert done.returncode == 1 and not (tmp_path / "a").exists()
    line = next(line for line in done.stdout.splitlines() if "the run needs" in line)
    assert str(tmp_path / "results") in line and "Traceback" not in done.stdout


@pytest.mark.workflow
def test_a_run_that_fails_says_where_its_log_is(tmp_path):
    (tmp_path / "fail").touch()
    done = little_run(tmp_path, 1e6)
    assert done.returncode == 1
    log = next((tmp_path / ".snakemake" / "log").glob("*.log"))
    assert f": 1 of 2 jobs. Snakemake's log: {log}" in done.stdout
    assert "Error in rule last" in done.stdout


@pytest.mark.workflow
def test_on_a_terminal_the_line_is_written_over(tmp_path):
    ours, theirs = pty.openpty()
    done = little_run(tmp_path, 1e6, terminal=theirs)
    os.close(theirs)
    shown = b""
    with suppress(OSError):  # the end: nobody holds the other side
        while part := os.read(ours, 1 << 16):
            shown += part
    os.close(ours)
    shown = shown.decode()
    assert done.returncode == 0
    assert re.search(r"\r1 of 2 jobs; \d+ s left; now: last\x1b\[K\r", shown)
