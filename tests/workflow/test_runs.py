"""Runs that are killed or meet in one folder, and a workflow that is deployed."""

import os
import shutil
import signal
import subprocess
import sys
import time

import pytest

import lfcore
from lfcore.workflow.job import RUN
from robustness.outcome import ROOT
from tests.robustness.kills import make_run

pytestmark = pytest.mark.workflow

SNAKEFILE = f"""
import os
os.environ.update({RUN}=str(os.getpid()))

rule slow:
    output: "made"
    log: "log"
    script: "slow.py"
"""
# It appends to a trace until it is told to hurry.
SLOW = """
import time
from pathlib import Path
from lfcore.workflow.job import job

with job(snakemake):
    Path(snakemake.output[0]).write_text("half")
    with open("trace", "a") as trace:
        while not Path("hurry").exists():
            trace.write("x")
            trace.flush()
            time.sleep(0.05)
    Path(snakemake.output[0]).write_text("whole")
"""
MAKE, BARE = make_run(""), (sys.executable, "-m", "snakemake", "--cores", "1")


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "Snakefile").write_text(SNAKEFILE)
    (tmp_path / "slow.py").write_text(SLOW)
    shutil.copytree(ROOT / "profiles" / "default", tmp_path / "profiles" / "default")
    return tmp_path


def start(folder, command):
    """A run of the little workflow; its output is in ``folder/terminal``."""
    with (folder / "terminal").open("ab") as terminal:
        return subprocess.Popen(
            command, cwd=folder, stdout=terminal, stderr=subprocess.STDOUT,
            env=os.environ | {"PYTHONPATH": str(ROOT)}, start_new_session=True,
        )  # fmt: skip


def until(condition, seconds=240.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it took too long"
        time.sleep(0.02)


def locks(folder):
    return list((folder / ".snakemake" / "locks").glob("*"))


def said(folder):
    return (folder / "terminal").read_text()


@pytest.mark.parametrize("command", [MAKE, BARE], ids=["make", "snakemake"])
def test_a_run_goes_on_by_itself_after_a_kill(folder, command):
    """Its job has ended before the next run writes, and no lock is in the way."""
    killed = start(folder, command)
    trace = folder / "trace"
    until(trace.exists)
    killed.send_signal(signal.SIGKILL)
    killed.wait()
    time.sleep(0.5)
    written = trace.stat().st_size
    time.sleep(0.5)
    assert trace.stat().st_size == written and locks(folder)
    (folder / "hurry").touch()
    assert start(folder, MAKE).wait(240) == 0, said(folder)
    assert (folder / "made").read_text() == "whole"


def test_two_runs_wait_for_a_third(folder):
    first = start(folder, MAKE)
    until((folder / "trace").exists)
    others = [start(folder, MAKE), start(folder, MAKE)]
    until(lambda: said(folder).count("Waiting for the run") == 2)
    (folder / "hurry").touch()
    assert [run.wait(240) for run in (first, *others)] == [0, 0, 0], said(folder)
    assert said(folder).count("Nothing to be done") == 2


def test_a_bare_snakemake_that_has_just_begun_keeps_its_lock(folder):
    bare = start(folder, BARE)
    until(lambda: locks(folder))
    assert start(folder, MAKE).wait(240) == 1
    assert "cannot be locked" in said(folder) and locks(folder)
    (folder / "hurry").touch()
    assert bare.wait(240) == 0, said(folder)
    assert (folder / "made").read_text() == "whole"


def test_a_job_that_begins_after_its_run_has_died_ends():
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    program = "from lfcore.workflow.job import end_with_run; end_with_run(); print('goes on')"
    for run, words in ((gone.pid, ""), (os.getpid(), "goes on\n")):
        done = subprocess.run(
            [sys.executable, "-c", program], env=os.environ | {RUN: str(run)},
            capture_output=True, text=True,
        )  # fmt: skip
        assert done.stdout == words


def test_the_workflow_is_linted_where_only_snakemake_is_installed(checkout, tmp_path):
    """As the workflow catalog does."""
    (tmp_path / "lfcore.py").write_text("raise ImportError('there is no lfcore here')\n")
    for name in ("Snakefile", "workflow", "config", "profiles"):
        source = checkout.folder / name
        (shutil.copytree if source.is_dir() else shutil.copy)(source, tmp_path / name)
    done = type(checkout)(tmp_path).snakemake("--lint", PYTHONPATH=str(tmp_path))
    assert done.returncode == 0, done.stdout


def test_a_deployed_workflow_runs_smoke(checkout, tmp_path):
    pytest.importorskip("snakedeploy")
    words = ("deploy-workflow", str(checkout.folder), str(tmp_path), "--branch=main", "--force")
    program = "import sys; from snakedeploy.client import main; sys.exit(main())"
    subprocess.run([sys.executable, "-c", program, *words], check=True)
    # Of a folder on this machine, snakedeploy writes the path without the folder.
    snakefile = tmp_path / "workflow" / "Snakefile"
    text = snakefile.read_text()
    assert '"workflow/Snakefile"' in text
    snakefile.write_text(text.replace('"workflow/', f'"{checkout.folder}/workflow/'))
    words = ("--cores", "2", "--configfile", "config/smoke.yaml", "--config", "scenes=[bike]")
    done = type(checkout)(tmp_path).snakemake(
        *words, "views=[16]", "reports=[focal_stack,quality]", PYTHONPATH=str(checkout.folder)
    )
    assert done.returncode == 0, done.stdout
    for name in ("index.html", "table_7_1.csv", "figures/focal_stack_bike.png"):
        assert (tmp_path / "results" / "tables" / name).is_file()


def test_a_misspelt_target_names_the_right_one(checkout):
    done = checkout.snakemake("--dry-run", "--quiet", "rules", "--", "tabels")
    assert done.returncode and "no target 'tabels'. Did you mean 'tables'" in done.stdout


def test_a_film_is_made_by_jobs_of_instants(project_copy):
    """An interrupted run's group of instants stays, and the file is that of one process."""
    checkout, moving = project_copy("film"), "scenes/sphere/moving.pbrt"
    how = ("--config", f"scenes=[{moving}]", "pixels=16", "film={frames: 6, fps: 5}", "--")
    group = "results/moving/M16/film/00000.segments"
    first = checkout.made("--notemp", *how, group)
    assert (first["film_ahead"], first["film_instants"]) == (1, 1)
    then = checkout.made(*how, "films")
    assert (then["film_instants"], then["film"]) == (1, 1) and "film_ahead" not in then
    assert not (checkout.folder / group).exists()
    scene = lfcore.load_scene(checkout.folder / moving, bare=True)
    times = [frame / 5 for frame in range(6)]
    alone = lfcore.record(scene, checkout.folder / "alone.mkv", times=times, pixels=16)
    film = checkout.folder / "results/moving/M16/film.mkv"
    assert film.read_bytes() == alone.path.read_bytes()
    how = ("--config", "scenes=[sphere]", "pixels=16", "film={frames: 2}", "--", "films")
    at_rest = checkout.snakemake("--cores", "1", *how)
    assert at_rest.returncode and "does not move" in at_rest.stdout
