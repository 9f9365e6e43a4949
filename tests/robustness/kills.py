"""Commands that are killed at random times: the same command must then give the same files."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from random import Random

import psutil

from lfcore.files import file_digest
from robustness.outcome import ROOT

WAYS = ("KILL", "KILL group", "KILL child", "TERM", "INT group")
"""The signals, and their receivers: the process alone, its group as by a terminal, or one child."""
STATUS = {"TERM": (143, -signal.SIGTERM), "INT group": (130, -signal.SIGINT)}
"""The proper exit statuses after a signal."""
LONGEST = 900.0
"""The seconds after which a run hangs; it takes some ten on an idle machine."""


@dataclass(frozen=True)
class Job:
    """A command that writes files.

    Attributes
    ----------
    name, command
        Its name and its words.
    results : tuple of str
        Patterns, below its folder, of files that must be the same in each run.
    prepare : callable
        Called with the empty folder before the first run.
    ways : tuple of str
        The ways to end it.
    statuses : bool
        Whether its exit status after a signal must be proper.
    """

    name: str
    command: tuple[str, ...]
    results: tuple[str, ...]
    prepare: Callable[[Path], None] = lambda folder: None
    ways: tuple[str, ...] = WAYS
    statuses: bool = True


class Killed:
    """A job in its folder, with the digests and wall seconds of an undisturbed run."""

    def __init__(self, job: Job, folder: Path):
        self.job, self.folder = job, folder
        folder.mkdir(parents=True)
        job.prepare(folder)
        self.whole, self.seconds = dict[str, str](), 0.0
        for _ in range(2):  # the first run fills caches
            self.clean()
            start = time.monotonic()
            status, output = self.run()
            self.seconds = time.monotonic() - start
            if status:
                raise RuntimeError(f"{job.name} fails undisturbed: {output}")
            before, self.whole = self.whole, self.digests()
        if before != self.whole or not self.whole:
            raise RuntimeError(f"two results of {job.name} differ: {before} {self.whole}")

    def clean(self) -> None:
        for name in ("results", "logs", ".snakemake", "out"):
            shutil.rmtree(self.folder / name, ignore_errors=True)
        (self.folder / "out").mkdir()

    def digests(self) -> dict[str, str]:
        """Return the name and SHA-256 of each result."""
        results = {file for pattern in self.job.results for file in self.folder.glob(pattern)}
        files = (file for file in results if not file.name.startswith(".snakemake"))
        return digests(filter(Path.is_file, files), self.folder)

    def drafts(self) -> list[str]:
        """Return hidden files and folders, which an undisturbed run does not leave."""
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
        """Run the command; return (status, output), with status 99 if it hangs."""
        process = self.start()
        output = until_end(process)
        return (99, "it does not end") if output is None else (process.returncode, output[-2000:])

    def disturb(self, draw: Random, way: str) -> list[str] | None:
        """Kill a run, and run again; return the problems, or None if it ended before."""
        self.clean()
        after = draw.uniform(0, 1.05 * self.seconds)
        problems = self._end(after, way)
        if problems is None:
            return None
        status, output = self.run()
        if status:
            problems.append(f"then status {status}: {output[-600:]}")
        elif self.digests() != self.whole:
            problems.append(f"other results: {self.digests()}")
        if self.drafts():
            problems.append(f"left over: {self.drafts()}")
        return [f"{way} after {after:.2f} of {self.seconds:.2f} s: {text}" for text in problems]

    def _end(self, after: float, way: str) -> list[str] | None:
        """Start and kill a run; return the problems, or None if it had ended."""
        process = self.start()
        with suppress(subprocess.TimeoutExpired):
            process.communicate(timeout=after)
            return None
        if not _strike(process.pid, way):
            process.communicate()
            return None
        output = until_end(process)
        if output is None:
            return ["it does not end"]
        # With status 0 the run had finished before the signal.
        if process.returncode == 0 or not self.job.statuses or way not in STATUS:
            return []
        problems = []
        if process.returncode not in STATUS[way]:
            problems.append(f"status {process.returncode}: {output[-300:]}")
        if "Traceback" in output:
            problems.append(f"a traceback: {output[-300:]}")
        if self.drafts():
            problems.append(f"left behind at once: {self.drafts()}")
        return problems


def digests(files: Iterable[Path], folder: Path) -> dict[str, str]:
    return {str(file.relative_to(folder)): file_digest(file) for file in sorted(files)}


def _strike(leader: int, way: str) -> bool:
    """Send the signal; return False if no process is left."""
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
            # The latest child is the job; earlier ones wait for it.
            max(children, key=lambda child: child.pid).send_signal(number)
            return True
        os.killpg(leader, signal.SIGKILL)
    return False


def until_end(process: subprocess.Popen) -> str | None:
    """Return the output of a process when it ends; kill one that hangs, and return None."""
    try:
        return process.communicate(timeout=LONGEST)[0].decode(errors="replace")
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return None


MICRO = {"scenes": ["sphere"], "views": [2, 4], "pixels": 16, "reports": []}
PARTS = ("Makefile", "Snakefile", "config", "lfcore", "profiles", "scenes", "workflow")


def copy_project(folder: Path) -> None:
    """Copy the project, with a configuration that takes seconds."""
    ignored = shutil.ignore_patterns("__pycache__", "*.pyc", ".*")
    for name in PARTS:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name, ignore=ignored)
        else:
            shutil.copy(ROOT / name, folder / name)
    (folder / "micro.yaml").write_text(json.dumps(MICRO))


def make_run(arguments: str) -> tuple[str, ...]:
    """Return the shell command of ``make tables`` in this environment."""
    printed = subprocess.run(
        ["make", "--no-print-directory", "-n", "-o", f"{sys.prefix}/installed", "tables",
         f"VENV={sys.prefix}", f"ARGS={arguments}", "DIRECTORY=."],
        cwd=ROOT, check=True, capture_output=True, text=True,
    )  # fmt: skip
    return ("sh", "-c", printed.stdout)


def jobs() -> dict[str, Job]:
    """Return the commands that are killed, by name."""
    scene = str(ROOT / "scenes/sphere")
    lfcore = (sys.executable, "-m", "lfcore")
    size = ("--pixels", "96", "--views", "32")  # some seconds of tracing
    goals = "results/sphere/M16/N4/planes/from_video results/sphere/M16/N2/planes/on_the_fly"
    commands = ("KILL", "TERM", "INT group")
    listed = [
        Job("trace", (*lfcore, "record", scene, "-o", "out/a.mkv", *size), ("out/*",),
            ways=commands),
        Job("render", (*lfcore, "render", scene, "-o", "out/a.ppm", *size), ("out/*",),
            ways=commands),
        Job("film", (*lfcore, "record", str(ROOT / "scenes/bike/ball.yaml"), "-o", "out/a.mkv",
            "--frames", "0:16", "--pixels", "96"), ("out/*",), ways=commands),
        Job("workflow", make_run(f"--configfile micro.yaml -- {goals}"), ("results/**/*.npz",
            "results/**/*.png", "results/**/*.mkv"), copy_project, statuses=False),
    ]  # fmt: skip
    return {job.name: job for job in listed}
