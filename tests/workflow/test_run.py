"""What a kill leaves behind, and what a full disk says: a workflow of one rule, in seconds."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lfcore.workflow import job, run

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.workflow

SNAKEFILE = f"""
import sys
sys.path.insert(0, {str(ROOT)!r})
from lfcore.workflow.run import hold

onstart:
    hold()

rule slow:
    output: "made"
    log: "log"
    script: "slow.py"
"""
# Writes on and on: its output appears late, its trace grows until it ends.
SLOW = f"""
import sys, time
sys.path.insert(0, {str(ROOT)!r})
from pathlib import Path
from lfcore.workflow.job import job

with job(snakemake.log[0], snakemake.threads):
    Path(snakemake.output[0]).write_text("half")
    with open("trace", "a") as trace:
        while not Path("hurry").exists():
            trace.write("x")
            trace.flush()
            time.sleep(0.05)
    Path(snakemake.output[0]).write_text("whole")
"""


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "Snakefile").write_text(SNAKEFILE)
    (tmp_path / "slow.py").write_text(SLOW)
    return tmp_path


def start(folder, *command):
    """A run of the little workflow; its output is in ``folder/terminal``."""
    environment = {name: value for name, value in os.environ.items() if name != run.VARIABLE}
    with (folder / "terminal").open("ab") as terminal:
        return subprocess.Popen(
            [sys.executable, *command, "--cores", "1", "--rerun-incomplete"],
            cwd=folder,
            env=environment | {"PYTHONPATH": str(ROOT)},
            stdout=terminal,
            stderr=subprocess.STDOUT,
        )


def until(condition, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it took too long"
        time.sleep(0.05)


@pytest.mark.parametrize("command", [("-m", "lfcore.workflow.run"), ("-m", "snakemake")])
def test_a_run_goes_on_by_itself_after_a_kill(folder, command):
    """Its job, which nobody ended, has ended before the next run writes; no lock is in its way."""
    killed = start(folder, *command)
    trace = folder / "trace"
    until(trace.exists)
    assert any((folder / ".snakemake" / "locks").iterdir())
    killed.send_signal(signal.SIGKILL)
    killed.wait()
    # The killed run's job ends without a word from anybody.
    until(lambda: run_is_over(folder), 10)
    written = trace.stat().st_size
    time.sleep(0.3)
    assert trace.stat().st_size == written
    (folder / "hurry").touch()
    again = start(folder, "-m", "lfcore.workflow.run")
    assert again.wait(60) == 0, (folder / "terminal").read_text()
    assert (folder / "made").read_text() == "whole"


def run_is_over(folder):
    """Whether no process holds a lock of a run there."""
    files = list((folder / ".snakemake" / "runs").glob("*"))
    assert len(files) == 1
    with files[0].open("rb+") as file:
        return run._taken(file)


def test_a_run_waits_for_one_that_is_alive(folder):
    first = start(folder, "-m", "lfcore.workflow.run")
    until((folder / "trace").exists)
    second = start(folder, "-m", "lfcore.workflow.run")
    until(lambda: "Waiting for the run of process" in (folder / "terminal").read_text())
    (folder / "hurry").touch()
    assert first.wait(60) == 0 and second.wait(60) == 0
    terminal = (folder / "terminal").read_text()
    assert f"process {first.pid}" in terminal and "Nothing to be done" in terminal
    assert "Traceback" not in terminal


def test_a_job_that_begins_after_its_run_has_died_ends(folder, monkeypatch):
    program = (
        "import time; from lfcore.workflow.job import end_with_run; end_with_run(); time.sleep(60)"
    )
    gone = folder / ".snakemake" / "runs" / "gone"
    environment = os.environ | {
        run.VARIABLE: f"{run.socket.gethostname()}:{gone}", "PYTHONPATH": str(ROOT),
    }  # fmt: skip
    assert subprocess.run([sys.executable, "-c", program], env=environment, timeout=30).returncode
    elsewhere = environment | {run.VARIABLE: f"another-host:{gone}"}
    quick = program.replace("60", "0.5")
    assert not subprocess.run([sys.executable, "-c", quick], env=elsewhere, timeout=30).returncode


JOB = """
import os, sys
from lfcore.errors import SceneError
from lfcore.workflow.job import job
with job(sys.argv[1], 1):
    {body}
"""


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("open('/dev/full', 'w', buffering=1).write('x' + chr(10))", "No space left on device."),
        ("raise SceneError('no triangles', file='a.obj')", "a.obj: no triangles."),
        ("open('absent/file')", "absent/file: No such file or directory."),
        # The log itself cannot grow any more, and there is something in its buffer.
        ("sys.stdout.write('x' * 9000 + 'y'); "
         "os.dup2(os.open('/dev/full', os.O_WRONLY), 1); print()", "No space left on device."),
    ],
)  # fmt: skip
def test_a_failure_is_one_line(tmp_path, body, words):
    done = subprocess.run(
        [sys.executable, "-c", JOB.format(body=body), str(tmp_path / "log")],
        cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.returncode == 1
    assert done.stderr.splitlines() == [words]


def test_a_job_that_is_done_cleans_up_and_says_what_it_took(tmp_path):
    body = "import tempfile; kept = tempfile.TemporaryDirectory(dir='.'); print(kept.name)"
    done = subprocess.run(
        [sys.executable, "-c", JOB.format(body=body) + "print('never')", "log"],
        cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    folder, took = (tmp_path / "log").read_text().splitlines()
    assert not (tmp_path / folder).exists() and job.usage(0)[:5] == took[:5]


def test_mistakes_of_ours_keep_their_traceback(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", JOB.format(body="1 / 0"), str(tmp_path / "log")],
        env=os.environ | {"PYTHONPATH": str(ROOT)}, timeout=60,
    )  # fmt: skip
    assert done.returncode == 1 and "ZeroDivisionError" in (tmp_path / "log").read_text()


def test_a_log_that_cannot_be_opened_is_one_line(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", JOB.format(body="pass"), str(tmp_path / "absent" / "log")],
        env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.returncode == 1 and "Traceback" not in done.stderr
    assert "No such file or directory" in done.stderr


def test_progress_says_the_end(capsys):
    progress = job.log_progress("rays", every_seconds=3600)
    for done in range(1, 4):
        progress(done, 3)
    assert capsys.readouterr().out == "rays: 3 of 3\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("layout: &a\n  kind: views\n  order: *a\n", ""),
        ("scenes: " + "[" * 3000 + "]" * 3000, ""),
        ("scenes: [", ""),
        (None, "not found"),
    ],
)
@pytest.mark.parametrize("option", [["--configfile", "FILE", "--"], ["--configfile=FILE"]])
def test_a_configuration_that_snakemake_dies_of_is_one_line(tmp_path, text, words, option):
    file = tmp_path / "config.yaml"
    if text is not None:
        file.write_text(text)
    arguments = [word.replace("FILE", str(file)) for word in option]
    with pytest.raises(SystemExit) as caught:
        run.main(["--cores", "1", *arguments])
    message = str(caught.value)
    assert str(file) in message and words in message and "\n" not in message


def test_configurations_that_are_right_are_passed_on():
    run.check_files(["--configfile", str(ROOT / "config/smoke.yaml"), "--", "results/tables/"])
    run.check_files(["--cores", "2", "results/tables/"])


@pytest.mark.parametrize(
    ("arguments", "folder"),
    [
        (["--cores", "2", "--directory", "/a/b", "--", "x"], "/a/b"),
        (["-d", "c"], "c"),
        (["--directory=/a"], "/a"),
        (["--cores", "2", "--", "--directory", "/a"], "."),
    ],
)
def test_the_folder_of_a_run(arguments, folder):
    assert run.folder_of(arguments) == Path(folder)


@pytest.mark.parametrize(("option", "limited"), [((), False), (("3/2s",), True)])
def test_ready_jobs_are_looked_at_when_a_job_ends(tmp_path, option, limited):
    """And not each second for each job that has ended, unless a limit was asked for."""
    rules = SNAKEFILE.replace("import hold", "import hold, schedule_when_jobs_end")
    rules = rules.replace("    hold()\n", "    hold()\n    schedule_when_jobs_end(workflow)\n")
    rules += """
onsuccess:
    print("limited:", workflow.scheduler.job_rate_limiter is not None)
"""
    (tmp_path / "Snakefile").write_text(rules.replace('script: "slow.py"', 'shell: "touch made"'))
    option = ("--max-jobs-per-timespan", *option) if option else ()
    command = [sys.executable, "-m", "snakemake", "--cores", "1", *option]
    told = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert f"limited: {limited}" in told.stdout
