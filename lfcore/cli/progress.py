"""Progress and remarks of a command on standard error, or a record of both for programs.

Within :func:`recorded` nothing is printed: :class:`lfcore.cli.command.Command` prints the record as
one JSON object (``--json``).
"""

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lfcore.opencl.program_cache import watching
from lfcore.progress import Progress

SHORTEST_S = 0.05
"""The shortest time for which a rate is reported."""
_records: list[dict[str, Any]] = []


@contextmanager
def progress(what: str, unit: str = "", *, rays: int = 0) -> Iterator[Progress]:
    """Yield ``report(done, total)``, which draws a bar on a terminal; ends with a line of seconds.

    The line has the rate of ``rays``, where given, without the seconds of OpenCL builds.
    """
    begun, builds = time.perf_counter(), _Builds()
    with _bar(what, unit, builds) as report, watching(builds):
        yield report
    seconds = time.perf_counter() - begun
    traced = seconds - builds.seconds
    rate = rays / traced if traced > SHORTEST_S else 0.0
    if _records:
        step: dict[str, Any] = {"what": what, "seconds": round(seconds, 3)}
        step["building_kernels_seconds"] = round(builds.seconds, 3)
        step |= {"rays": rays} if rays else {}
        _records[-1]["steps"].append(step | ({"rays_per_second": round(rate)} if rate else {}))
        return
    line = f"{what}: {seconds:.1f} s"
    line += f", {builds.seconds:.1f} s of them building kernels" if builds.seconds >= 0.1 else ""
    say(line + (f", {rate / 1e6:.3g} million rays per second" if rate else ""))


class _Builds:
    """The seconds in which at least one thread builds a program."""

    def __init__(self) -> None:
        self.seconds, self.changed = 0.0, lambda building: None
        self._threads, self._since, self._lock = 0, 0.0, threading.Lock()

    def __call__(self, begins: bool) -> None:
        with self._lock:
            self._threads += 1 if begins else -1
            if begins and self._threads == 1:
                self._since = time.perf_counter()
            elif not self._threads:
                self.seconds += time.perf_counter() - self._since
            self.changed(self._threads > 0)


@contextmanager
def _bar(what: str, unit: str, builds: _Builds) -> Iterator[Progress]:
    """A bar that is there while the block runs; none where standard error is no terminal."""
    if _records or not sys.stderr.isatty():
        yield lambda done, total: None
        return
    from rich import progress as bars
    from rich.console import Console

    columns = "{task.description}", bars.BarColumn(), bars.MofNCompleteColumn(), unit
    console = Console(file=sys.stderr)
    with bars.Progress(
        *columns, bars.TimeRemainingColumn(), console=console, transient=True
    ) as shown:
        task = shown.add_task(what, total=None)
        builds.changed = lambda building: shown.update(
            task, description="building kernels" if building else what
        )
        yield lambda done, total: shown.update(task, completed=done, total=total)


def say(text: str) -> None:
    """A line on standard error."""
    if _records:
        _records[-1]["said"].append(text)
    else:
        print(text, file=sys.stderr)


def wrote(path: Path, more: str = "") -> None:
    """Say that a file was written."""
    if _records:
        parts = [part for part in path.rglob("*") if part.is_file()] if path.is_dir() else [path]
        size = sum(part.stat().st_size for part in parts)
        _records[-1]["files"].append({"file": str(path), "bytes": size})
    else:
        say(f"wrote {path}{more}")


def note(**facts: Any) -> None:
    """Facts for programs alone: keys of the record, if one is kept."""
    if _records:
        _records[-1] |= facts


@contextmanager
def recorded(command: str) -> Iterator[dict[str, Any]]:
    """Keep what the block says instead of printing it."""
    record: dict[str, Any] = {"command": command, "files": [], "steps": [], "said": []}
    _records.append(record)
    try:
        yield record
    finally:
        _records.pop()
