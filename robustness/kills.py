"""Runs that are killed at random times: the plain command must go on and end as undisturbed."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

import psutil

from lfcore.files import file_digest
from robustness.outcome import ROOT

WAYS = ("KILL", "KILL group", "KILL child", "TERM", "INT group")
"""How a run is ended: the process alone, all of its group as a terminal does, or one child."""
STATUS = {"TERM": (143, -signal.SIGTERM), "INT group": (130, -signal.SIGINT)}
LONGEST = 900.0
"""Seconds after which a run, which takes some ten on a quiet machine, is taken to hang."""


@dataclass(frozen=True)
class Job:
    """A command that makes files.

    ``results`` are patterns of the files that must be the same each time, below its folder;
    ``ways`` how it may be ended.
    """

    name: str
    command: tuple[str, ...]
    results: tuple[str, ...]
    prepare: Callable[[Path], None] = lambda folder: None
    ways: tuple[str, ...] = WAYS
    statuses: bool = True


@dataclass
class Tally:
    """Of the kills of one job in one way; ``findings`` say what went wrong, with the time."""

    kills: int = 0
    went_on: int = 0
    identical: int = 0
    slowest: float = 0.0
    findings: list[str] = field(default_factory=list)


class Killed:
    """A job with its folder, what it makes undisturbed, and how long that takes."""

    def __init__(self, job: Job, folder: Path):
        self.job, self.folder = job, folder
        folder.mkdir(parents=True)
        job.prepare(folder)
        self.whole, self.seconds = dict[str, str](), 0.0
        for _ in range(2):  # the first run fills caches
            self.clean()
            start = time.monotonic()
            status, said = self.run()
            self.seconds = time.monotonic() - start
            if status:
                raise RuntimeError(f"{job.name} fails undisturbed: {said}")
            before, self.whole = self.whole, self.digests()
        if before != self.whole or not self.whole:
            raise RuntimeError(f"{job.name} does not make the same twice: {before} {self.whole}")

    def clean(self) -> None:
        for name in ("results", "logs", ".snakemake", "out"):
            shutil.rmtree(self.folder / name, ignore_errors=True)
        (self.folder / "out").mkdir()

    def digests(self) -> dict[str, str]:
        """Name and SHA-256 of each result."""
        found = {file for pattern in self.job.results for file in self.folder.glob(pattern)}
        files = (file for file in found if not file.name.startswith(".snakemake"))
        return digests(filter(Path.is_file, files), self.folder)

    def drafts(self) -> list[str]:
        """Hidden files and folders that were not there undisturbed."""
        hidden = [*self.folder.glob("out/.*"), *self.folder.glob("results/**/.*")]
        return [str(file) for file in hidden if not file.name.startswith(".snakemake")]

    def start(self) -> subprocess.Popen:
        package = self.folder if (self.folder / "lfcore").is_dir() else ROOT
        return subprocess.Popen(
            self.job.command,
            cwd=self.folder,
            env=os.environ | {"PYTHONPATH": str(package)},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )

    def run(self) -> tuple[int, str]:
        """The plain command: (status, what it said); a status of 99 when it does not end."""
        process = self.start()
        said = until_end(process)
        return (99, "it does not end") if said is None else (process.returncode, said[-2000:])

    def disturb(self, draw: Random, way: str, tally: Tally) -> None:
        self.clean()
        after = draw.uniform(0, 1.05 * self.seconds)
        note = f"{self.job.name}, {way} after {after:.2f} of {self.seconds:.2f} s"
        if not self._end(after, way, tally, note):
            return
        tally.kills += 1
        status, said = self.run()
        if status:
            tally.findings.append(f"{note}: then status {status}: {said[-600:]}")
            return
        tally.went_on += 1
        if self.digests() == self.whole:
            tally.identical += 1
        else:
            tally.findings.append(f"{note}: other results: {self.digests()}")
        if self.drafts():
            tally.findings.append(f"{note}: left over: {self.drafts()}")

    def _end(self, after: float, way: str, tally: Tally, note: str) -> bool:
        """Start and kill; whether it was still running then."""
        process = self.start()
        with suppress(subprocess.TimeoutExpired):
            process.communicate(timeout=after)
            return False
        began = time.monotonic()
        if not _strike(process.pid, way):
            process.communicate()
            return False
        said = until_end(process)
        if said is None:
            tally.findings.append(f"{note}: it does not end")
            return True
        if self.job.statuses and way in STATUS:
            took = time.monotonic() - began
            tally.slowest = max(tally.slowest, took)
            tally.findings += [f"{note}: {wrong}" for wrong in self._wrong(process, way, said)]
        return True

    def _wrong(self, process: subprocess.Popen, way: str, said: str) -> Iterator[str]:
        if process.returncode == 0:
            return  # it had done all when the signal came
        if process.returncode not in STATUS[way]:
            yield f"status {process.returncode}: {said[-300:]}"
        if "Traceback" in said:
            yield f"a traceback: {said[-300:]}"
        if self.drafts():
            yield f"left behind at once: {self.drafts()}"


def started(words: Sequence[str], said: Path, environment: Mapping[str, str]) -> subprocess.Popen:
    """A process in a session of its own, whose output is added to the file ``said``."""
    with said.open("ab") as file:
        return subprocess.Popen(
            words, cwd=ROOT, env=environment, stdin=subprocess.DEVNULL, stdout=file,
            stderr=subprocess.STDOUT, start_new_session=True,
        )  # fmt: skip


def digests(files: Iterable[Path], folder: Path) -> dict[str, str]:
    return {str(file.relative_to(folder)): file_digest(file) for file in sorted(files)}


def _strike(leader: int, way: str) -> bool:
    """Send the signal; False when there is nobody to send it to."""
    number = getattr(signal, f"SIG{way.split()[0]}")
    with suppress(ProcessLookupError, psutil.NoSuchProcess):
        if way.endswith("group"):
            os.killpg(leader, number)
            return True
        if not way.endswith("child"):
            os.kill(leader, number)
            return True
        children = psutil.Process(leader).children(recursive=True)
        if children:
            # The latest one: the job, not the one that waits.
            max(children, key=lambda one: one.pid).send_signal(number)
            return True
        os.killpg(leader, signal.SIGKILL)
    return False


def until_end(process: subprocess.Popen) -> str | None:
    """What a process says until it ends; None, and an end, for one that hangs."""
    try:
        return process.communicate(timeout=LONGEST)[0].decode(errors="replace")
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return None


MICRO = {"scenes": ["sphere"], "views": [2, 4], "pixels": 16, "reports": []}
PARTS = ("Makefile", "Snakefile", "config", "lfcore", "profiles", "scenes", "workflow")


def copy_project(folder: Path) -> None:
    """The project itself, and a configuration of a run of seconds."""
    ignored = shutil.ignore_patterns("__pycache__", "*.pyc", ".*")
    for name in PARTS:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name, ignore=ignored)
        else:
            shutil.copy(ROOT / name, folder / name)
    (folder / "micro.yaml").write_text(json.dumps(MICRO))


def make_run(arguments: str) -> tuple[str, ...]:
    """The shell command of ``make tables`` in this environment."""
    said = subprocess.run(
        ["make", "--no-print-directory", "-n", "-o", f"{sys.prefix}/installed", "tables",
         f"VENV={sys.prefix}", f"ARGS={arguments}", "DIRECTORY=."],
        cwd=ROOT, check=True, capture_output=True, text=True,
    )  # fmt: skip
    return ("sh", "-c", said.stdout)


def jobs() -> list[Job]:
    scene = str(ROOT / "scenes/sphere")
    lfcore = (sys.executable, "-m", "lfcore")
    size = ("--pixels", "96", "--views", "32")  # some seconds of tracing
    made = "results/sphere/M16/N4/planes/from_video results/sphere/M16/N2/planes/on_the_fly"
    commands = ("KILL", "TERM", "INT group")
    return [
        Job("trace", (*lfcore, "record", scene, "-o", "out/a.mkv", *size), ("out/*",),
            ways=commands),
        Job("render", (*lfcore, "render", scene, "-o", "out/a.ppm", *size), ("out/*",),
            ways=commands),
        Job("workflow", make_run(f"--configfile micro.yaml -- {made}"), ("results/**/*.npz",
            "results/**/*.png", "results/**/*.mkv"), copy_project, statuses=False),
    ]  # fmt: skip
