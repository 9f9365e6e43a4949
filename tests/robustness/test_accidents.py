"""Kills, full disks and unusual surroundings: a short form, and `pytest -m accidents` for all."""

import os
import subprocess
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path
from random import Random

import pytest

from robustness.outcome import LONGEST_MESSAGE, OK, REFUSED, ROOT
from tests.robustness import kills, small_disks
from tests.robustness.small_disks import Writer

pytestmark = pytest.mark.slow

KILLS = 34
"""The kills of each command."""
WORKFLOW_PAGES = (1, 300, 480, 530)
"""The pages of disks without room for anything, for a scene, its hierarchy, and a light field."""

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
    if reason := small_disks.can_mount(home):
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
    outcomes = small_disks.fill(Writer("bad", "bad.bin", write), home)
    assert {outcome.kind for _, outcome in outcomes} == {"silent wrong", "ok"}


@pytest.mark.parametrize("careless", [False, True])
def test_what_a_kill_changes_is_found(tmp_path, careless):
    program = tmp_path / "program.py"
    program.write_text(PROGRAM.format(careless=careless))
    job = kills.Job("program", (sys.executable, str(program)), ("out/*",))
    killed, draw, problems, count = kills.Killed(job, tmp_path / "run"), Random(3), [], 0
    while count < 2:
        # Late enough that the program has begun.
        found = killed.disturb(draw, "KILL")
        problems, count = problems + (found or []), count + (found is not None)
        (tmp_path / "run" / "left").unlink(missing_ok=True)
    assert ("other results" in "".join(problems)) == careless
    assert careless or not problems


def test_a_run_that_hangs_is_ended(monkeypatch):
    monkeypatch.setattr(kills, "LONGEST", 1.0)
    program = "import time; time.sleep(60)"
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, start_new_session=True
    )
    assert kills.until_end(process) is None and process.returncode < 0


def test_a_render_that_is_killed_goes_on_and_is_identical(tmp_path):
    render = kills.jobs()["render"]
    small = replace(render, command=(*render.command[:-4], "--pixels", "16", "--views", "4"))
    killed, draw = kills.Killed(small, tmp_path / "run"), Random(5)
    for way in ("KILL", "TERM"):
        assert not killed.disturb(draw, way)


@pytest.mark.accidents
@pytest.mark.parametrize("name", ["trace", "render", "film", "workflow"])
def test_commands_that_are_killed_go_on_and_are_identical(tmp_path, name):
    job, draw, count = kills.jobs()[name], Random(1), 0
    killed = kills.Killed(job, tmp_path / "run")
    while count < KILLS:
        found = killed.disturb(draw, draw.choice(job.ways))
        assert not found, found
        count += found is not None


@pytest.mark.accidents
def test_files_on_full_disks_are_whole_or_refused(home):
    for writer in small_disks.writers(home):
        outcomes = small_disks.fill(writer, home)
        assert not [each for each in outcomes if each[1].is_finding], writer.name
        assert {outcome.kind for _, outcome in outcomes} == {OK, REFUSED}, writer.name


@pytest.mark.accidents
def test_a_workflow_on_a_full_disk_continues_when_there_is_room(home):
    run = kills.Killed(kills.jobs()["workflow"], home / "workflow")
    outcomes = small_disks.fill_workflow(run, WORKFLOW_PAGES)
    assert not [each for each in outcomes if each[1].is_finding]


@dataclass(frozen=True)
class Surrounding:
    """The environment of a command, with ``{folder}`` for its working folder.

    Attributes
    ----------
    name : str
        A description.
    works : bool
        Whether the command must write the undisturbed picture; else it must fail with status 1 and
        one line.
    environment : dict
        Changed variables; None removes one.
    output : str
        The picture's path.
    redirect : str
        A redirection of the shell.
    """

    name: str
    works: bool = True
    environment: dict = field(default_factory=dict)
    output: str = "p.ppm"
    redirect: str = ""


UNDISTURBED = Surrounding("undisturbed")
SURROUNDINGS = [
    Surrounding("home is /dev/null", environment={"HOME": "/dev/null"}),
    Surrounding("home does not exist", environment={"HOME": "/nowhere/at/all"}),
    Surrounding("home cannot be written", environment={"HOME": "/proc"}),
    Surrounding("no home is named", environment={"HOME": None}),
    Surrounding("cache is empty", environment={"XDG_CACHE_HOME": "{folder}/empty"}),
    Surrounding("cache is a file", environment={"XDG_CACHE_HOME": "{folder}/plain-file"}),
    Surrounding("cache cannot be written", environment={"XDG_CACHE_HOME": "/proc/sys"}),
    Surrounding(
        "no home, no cache, no temporary folder",
        environment={"HOME": "/dev/null", "XDG_CACHE_HOME": "/proc", "TMPDIR": "/nowhere"},
    ),
    Surrounding("ASCII terminal", environment={"LC_ALL": "C", "PYTHONIOENCODING": "ascii"}),
    Surrounding("standard input is closed", redirect="<&-"),
    Surrounding("standard output is closed", redirect=">&-"),
    Surrounding("standard error is closed", redirect="2>&-"),
    Surrounding("standard output is full", redirect=">/dev/full"),
    Surrounding("the output's folder is new", output="new/folder/p.ppm"),
    Surrounding("the output is a folder", works=False, output="."),
    Surrounding("the output is below a file", works=False, output="plain-file/p.ppm"),
    Surrounding("the output cannot be written", works=False, output="/proc/p.ppm"),
    Surrounding("threads: abc", works=False, environment={"LFCORE_THREADS": "abc"}),
    Surrounding("threads: -1", works=False, environment={"LFCORE_THREADS": "-1"}),
    Surrounding("an unknown device", works=False, environment={"LFCORE_DEVICE": "no such"}),
]
DAILY = (
    "home is /dev/null",
    "standard error is closed",
    "the output is below a file",
    "threads: abc",
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A working folder with a file and an empty folder, and the undisturbed picture."""
    folder = tmp_path_factory.mktemp("surroundings")
    (folder / "plain-file").write_text("")
    (folder / "empty").mkdir()
    done = render(UNDISTURBED, folder)
    assert done.returncode == 0, done.stderr
    (folder / "p.ppm").rename(folder / "right.ppm")
    return folder


def render(surrounding, folder):
    environment = os.environ | {"PYTHONPATH": str(ROOT)} | surrounding.environment
    environment = {k: v.format(folder=folder) for k, v in environment.items() if v is not None}
    command = [sys.executable, "-m", "lfcore", "render", str(ROOT / "scenes/sphere")]
    command += ["-o", surrounding.output, "--pixels", "16", "--views", "2"]
    if surrounding.redirect:
        command = ["sh", "-c", f'exec "$@" {surrounding.redirect}', "sh", *command]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, timeout=600)


@pytest.mark.parametrize(
    "surrounding",
    [
        pytest.param(each, id=each.name, marks=() if each.name in DAILY else pytest.mark.accidents)
        for each in SURROUNDINGS
    ],
)
def test_surroundings_that_are_not_as_they_should(folder, surrounding):
    picture = folder / surrounding.output
    picture.unlink(missing_ok=True) if picture.is_file() else None
    done = render(surrounding, folder)
    output = done.stderr.decode(errors="replace") + done.stdout.decode(errors="replace")
    assert "Traceback" not in output
    assert done.returncode == (0 if surrounding.works else 1), output[-400:]
    if surrounding.works:
        assert picture.read_bytes() == (folder / "right.ppm").read_bytes()
    else:
        assert 0 < len(output.strip().rpartition("\n")[2]) <= LONGEST_MESSAGE
