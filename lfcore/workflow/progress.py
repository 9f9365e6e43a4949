"""How far a run is: a forecast before its first job, then one line.

Snakemake says through its logger which job begins and ends.  On a terminal the line is written
over and over; elsewhere there is a line a minute.  What each job took is kept in
``.snakemake/took.csv``: the next run's forecast is at this machine's pace, and
``python -m benchmarks.job_costs`` makes the table of costs of it.
"""

from __future__ import annotations

import csv
import logging
import os
import re
import sys
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TextIO

from lfcore.timing import duration
from lfcore.workflow import costs
from lfcore.workflow.forecast import (
    START_SECONDS,
    Task,
    check_disk,
    check_memory,
    forecast,
    rays_of,
)
from lfcore.workflow.run import QUIET

TOOK = Path(".snakemake") / "took.csv"
EVERY_SECONDS = 60.0
TRUSTED_SECONDS = 300.0
"""Jobs must have taken about so long before their pace counts as much as the measured one."""
LATEST = 60
"""Jobs whose pace is told of this machine."""
TOLD_SHARE = 0.1
"""A job of which so much is done says by its own pace how long the rest takes."""
SHARE = re.compile(rb": (\d+) of (\d+)$", re.MULTILINE)
USAGE = re.compile(rb"^took ([\d.]+) s, ([\d.]+) core s, (\d+) MiB$", re.MULTILINE)
"""The last line of a job's log; see :func:`lfcore.workflow.job.usage`."""


@dataclass(frozen=True)
class Stage:
    """What a job is of, as its log file says: a stage, perhaps of one scene and N."""

    name: str
    scene: str = ""
    views: int = 0
    batch: str = ""

    @classmethod
    def of_log(cls, log: str, scenes: Iterable[str]) -> Stage:
        """``logs/trace/bike/N16/0001.log`` is batch 0001 of stage ``trace`` of bike at N = 16."""
        known, rest = set(scenes), []
        found: dict[str, Any] = {}
        for part in Path(log).with_suffix("").parts:
            if part in known and "scene" not in found:
                found["scene"] = part
            elif re.fullmatch(r"N\d+", part):
                found["views"] = int(part[1:])
            elif re.fullmatch(r"\d{4}", part) and "views" in found:
                found["batch"] = part
            elif part != "logs":
                rest.append(part)
        return cls("/".join(rest), **found)

    def __str__(self) -> str:
        views = f"N = {self.views}" if self.views else ""
        return " ".join(filter(None, (self.name.replace("_", " "), self.scene, views)))


@dataclass(frozen=True, kw_only=True)
class Job(Task):
    """A task of the run: of which stage it is, and its files.

    ``share`` is its part of all jobs of its stage, scene and N.
    """

    stage: Stage
    share: float
    log: str
    kept: list[str]
    temporary: list[str]

    def done_share(self) -> float:
        """How much of it is done, by the last line in its log that says so."""
        found = SHARE.findall(_tail(self.log))
        done, of_all = map(int, found[-1]) if found else (0, 1)
        return min(done / of_all, 1.0) if of_all else 0.0


def _tail(log: str) -> bytes:
    with suppress(OSError), open(log, "rb") as file:
        file.seek(max(0, os.fstat(file.fileno()).st_size - 4096))
        return file.read()
    return b""


class Progress(logging.Handler):
    """What Snakemake's logger says, kept as how far the run is."""

    def __init__(
        self,
        jobs: Mapping[int, Job],
        *,
        cores: int,
        pixels: int,
        pace: float,
        took: Path = TOOK,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """``jobs`` by Snakemake's number of them."""
        super().__init__()
        self.jobs, self.left = dict(jobs), dict(jobs)
        self.begun: dict[int, float] = {}
        self.cores, self.pixels, self.pace, self.took = cores, pixels, pace, took
        self.clock, self.started = clock, clock()
        self._actual = self._forecast = 0.0

    def emit(self, record: logging.LogRecord) -> None:
        """Take a job's begin or end; all other records are passed over."""
        event = str(getattr(getattr(record, "event", None), "value", ""))
        if event == "job_started":
            now = self.clock()
            self.begun |= dict.fromkeys(getattr(record, "jobs", None) or (), now)
        elif event == "job_finished":
            number = getattr(record, "job_id", -1)
            if job := self.left.pop(number, None):
                now = self.clock()
                self._end(job, now - self.begun.get(number, now))

    def _end(self, job: Job, wall: float) -> None:
        stage = job.stage
        self._actual += wall
        self._forecast += job.seconds()
        if found := USAGE.findall(_tail(job.log)):
            _, core, mib = map(float, found[-1])
            row = {
                "stage": stage.name, "scene": stage.scene, "N": stage.views, "M": self.pixels,
                "share": job.share, "threads": job.threads, "wall_seconds": round(wall, 2),
                "core_seconds": core, "mib": mib, "kept_bytes": sum(map(_bytes, job.kept)),
                "temporary_bytes": sum(map(_bytes, job.temporary)),
                "forecast_seconds": round(job.seconds(), 2),
            }  # fmt: skip
            with suppress(OSError):  # a full disk is for the jobs to say
                _append(self.took, row)

    @property
    def done(self) -> int:
        """How many jobs have ended."""
        return len(self.jobs) - len(self.left)

    def pace_now(self) -> float:
        """Seconds here for a measured one: of the jobs that are done, and of runs before."""
        trusted = TRUSTED_SECONDS
        return (self._actual + trusted * self.pace) / (self._forecast + trusted)

    def seconds_left(self) -> float:
        """Forecast of the jobs that are left, of running ones what is not done."""
        pace, left = self.pace_now(), dict(self.left)
        for number in left.keys() & self.begun.keys():
            job, gone = left[number], self.clock() - self.begun[number]
            rest = self._rest(job, gone, pace) / pace - START_SECONDS
            left[number] = replace(job, cost=replace(job.cost, core_seconds=rest * job.threads))
        return forecast(left, self.cores, pace).seconds

    @staticmethod
    def _rest(job: Job, gone: float, pace: float) -> float:
        """Seconds that a running job has left: by its own log if that says enough, else as told."""
        share = job.done_share()
        if share >= TOLD_SHARE:
            return gone * (1 - share) / share
        whole = job.seconds(pace)
        return max(whole - gone, whole / 20)

    def line(self) -> str:
        """Rays done of all, jobs, time left, what runs now."""
        left = dict(self.left)
        running = [job for number, job in left.items() if number in self.begun]
        parts = [f"{self.done} of {len(self.jobs)} jobs", f"{duration(self.seconds_left())} left"]
        if rays := sum(job.rays for job in self.jobs.values()):
            undone = sum(job.rays for job in left.values())
            begun = sum(round(job.rays * job.done_share()) for job in running)
            parts.insert(0, rays_of(rays - undone + begun, rays))
        names = ", ".join(dict.fromkeys(str(job.stage) for job in running))
        return "; ".join([*parts, f"now: {names}"] if names else parts)


def _bytes(path: str) -> int:
    """Of a file, or of all files of a folder; 0 of what is gone."""
    place = Path(path)
    files = [place, *place.rglob("*")] if place.is_dir() else [place]
    return sum(file.stat().st_size for file in files if file.is_file())


def _append(file: Path, row: dict) -> None:
    with file.open("a", encoding="utf-8", newline="") as text:
        writer = csv.DictWriter(text, row, lineterminator="\n")
        if not text.tell():
            writer.writeheader()
        writer.writerow(row)


def pace_before(took: Path = TOOK) -> float:
    """Seconds of this machine for a measured one, of the jobs that ended here last; else 1."""
    try:
        with took.open(encoding="utf-8", newline="") as text:
            rows = list(csv.DictReader(text))[-LATEST:]
        actual = sum(float(row["wall_seconds"]) for row in rows)
        expected = sum(float(row["forecast_seconds"]) for row in rows)
    except (OSError, ValueError, KeyError, TypeError):
        return 1.0
    return (actual + TRUSTED_SECONDS) / (expected + TRUSTED_SECONDS)


class Line(threading.Thread):
    """Says ``progress.line()`` now and then: rewritten on a terminal, else a line a minute."""

    def __init__(self, progress: Progress, stream: TextIO, *, rewritten: bool) -> None:
        super().__init__(daemon=True, name="progress")
        self.progress, self.stream, self.rewritten = progress, stream, rewritten
        self.over = threading.Event()

    def run(self) -> None:
        while not self.over.wait(1.0 if self.rewritten else EVERY_SECONDS):
            self._say(self.progress.line())

    def clear(self) -> None:
        if self.rewritten:
            self._say("")

    def _say(self, line: str) -> None:
        with suppress(OSError, ValueError):  # a terminal that was closed
            if self.rewritten:
                width = os.get_terminal_size(self.stream.fileno()).columns or 80
                line = f"\r{line[: width - 1]}\x1b[K\r"
            self.stream.write(line if self.rewritten else f"{line}\n")
            self.stream.flush()


class _Errors(logging.Filter):
    """Of Snakemake's own words the terminal has warnings and errors; its log file has all."""

    def filter(self, record: logging.LogRecord) -> bool:
        if record.levelno < logging.WARNING:
            return record.getMessage().startswith("Nothing to be done")
        for line in _running:
            line.clear()
        return True


_running: list[Line] = []


def hush(workflow: Any) -> None:
    """Leave Snakemake's words to its log file, where :mod:`lfcore.workflow.run` asks for it."""
    if QUIET in os.environ:
        for handler in workflow.logger_manager.logger.handlers:
            if handler.name == "DefaultStreamHandler":
                handler.addFilter(_Errors())


def known_jobs(
    dag: Any, scenes: Iterable[str], pixels: int, batches: Mapping[int, Mapping[str, costs.Batch]]
) -> dict[int, Job]:
    """The jobs that are left to make, by Snakemake's number of them.

    Parameters
    ----------
    dag : Snakemake's graph of jobs; those without a log only name files.
    batches : of each N, by their name in log files.
    """
    names, found = list(scenes), {}
    for job in dag.needrun_jobs():
        if not job.log:
            continue
        stage, share, rays = Stage.of_log(str(job.log[0]), names), 1.0, 0
        if stage.batch:
            cut = batches[stage.views]
            rays = cut[stage.batch].rays
            share = rays / sum(one.rays for one in cut.values())
        cost = costs.job_cost(stage.name, stage.scene, stage.views, pixels).of_share(share)
        after = [other.jobid for other in dag.job_dependencies(job)]
        found[job.jobid] = Job(
            cost, job.threads, job.priority, after, rays,
            stage=stage, share=share, log=str(job.log[0]),
            kept=[str(file) for file in job.output if file not in job.temp_output],
            temporary=[str(file) for file in job.output if file in job.temp_output],
        )  # fmt: skip
    return found


def begin(workflow: Any, jobs: dict[int, Job], pixels: int) -> None:
    """Say what the run will take, refuse a disk that is too small, and show how far it is.

    ``workflow`` is Snakemake's, whose ``jobs`` are planned.  Raises :class:`SettingsError` for a
    disk that is too small.
    """
    cores = workflow.resource_settings.cores or workflow.resource_settings.nodes or 1
    pace = pace_before()
    expected = forecast(jobs, cores, pace)
    print(expected.text(cores), file=sys.stderr, flush=True)
    if workflow.storage_registry.default_storage_provider is None:
        check_disk(expected, "results")
    if warning := check_memory(expected):
        print(warning, file=sys.stderr, flush=True)
    progress = Progress(jobs, cores=cores, pixels=pixels, pace=pace)
    line = Line(progress, sys.stderr, rewritten=QUIET in os.environ and sys.stderr.isatty())
    workflow.logger_manager.logger.addHandler(progress)
    line.start()
    _running.append(line)


def end(log: Iterable[str] = ()) -> None:
    """Say that the run is over; one that failed names Snakemake's ``log``."""
    for line in _running:
        line.over.set()
        line.clear()
        seen = line.progress
        words = f"{duration(seen.clock() - seen.started)}: {seen.done} of {len(seen.jobs)} jobs."
        logs = [f"Snakemake's log: {file}" for file in log]
        print(f"{'Stopped' if logs else 'Done'} after {words}", *logs, file=sys.stderr)
    _running.clear()
