"""Progress and remarks of a command on standard error, or a record of both for programs.

Within :func:`recorded` nothing is printed; with ``--json``, the command then prints the record as
one JSON object.
"""

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lfcore.errors import printable
from lfcore.progress import BUILDING, Progress, watching

SHORTEST_S = 0.05
"""The shortest time with a reported rate: below it, rates are noise."""
_records: list[dict[str, Any]] = []


@contextmanager
def progress(title: str, unit: str = "", *, rays: int = 0) -> Iterator[Progress]:
    """Yield ``report(done, total)``, which draws a bar on a terminal; then report the seconds.

    The report has the rate of ``rays``, if given, in the time outside stages.
    """
    begun, stages = time.perf_counter(), _Stages()
    with _bar(title, unit, stages) as report, watching(stages):
        yield report
    seconds = time.perf_counter() - begun
    traced = seconds - sum(stages.seconds.values())
    rate = rays / traced if traced > SHORTEST_S else 0.0
    if _records:
        step: dict[str, Any] = {"what": title, "seconds": round(seconds, 3)}
        for name, of_it in stages.seconds.items():
            step[f"{name.replace(' ', '_')}_seconds"] = round(of_it, 3)
        step |= {"rays": rays} if rays else {}
        _records[-1]["steps"].append(step | ({"rays_per_second": round(rate)} if rate else {}))
        return
    line = f"{title}: {seconds:.1f} s"
    for name, of_it in stages.seconds.items():
        line += f", {of_it:.1f} s of them {name}" if of_it >= 0.1 else ""
    say(line + (f", {rate / 1e6:.3g} million rays per second" if rate else ""))


class _Stages:
    """The seconds of each stage; of several running stages the last one counts."""

    def __init__(self) -> None:
        self.seconds, self.changed = {BUILDING: 0.0}, lambda name: None
        self._running, self._since, self._lock = list[str](), 0.0, threading.Lock()

    def __call__(self, name: str, begins: bool) -> None:
        with self._lock:
            before, self._since = self._since, time.perf_counter()
            if self._running:
                last = self._running[-1]
                self.seconds[last] = self.seconds.get(last, 0.0) + self._since - before
            (self._running.append if begins else self._running.remove)(name)
            self.changed(self._running[-1] if self._running else None)


@contextmanager
def _bar(title: str, unit: str, stages: _Stages) -> Iterator[Progress]:
    """Show a bar while the block runs, if standard error is a terminal."""
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
        task = shown.add_task(title, total=None)
        stages.changed = lambda name: shown.update(task, description=name or title)
        yield lambda done, total: shown.update(task, completed=done, total=total)


def say(text: str) -> None:
    """Print a line on standard error, or record it."""
    if _records:
        _records[-1]["said"].append(text)
    else:
        print(printable(text), file=sys.stderr)


def wrote(path: Path, more: str = "") -> None:
    """Report a written file."""
    if _records:
        parts = [part for part in path.rglob("*") if part.is_file()] if path.is_dir() else [path]
        size = sum(part.stat().st_size for part in parts)
        _records[-1]["files"].append({"file": str(path), "bytes": size})
    else:
        say(f"wrote {path}{more}")


def note(**facts: Any) -> None:
    """Add keys to the record, if there is one."""
    if _records:
        _records[-1] |= facts


@contextmanager
def recorded(command: str) -> Iterator[dict[str, Any]]:
    """Record the block's output instead of printing it."""
    record: dict[str, Any] = {"command": command, "files": [], "steps": [], "said": []}
    _records.append(record)
    try:
        yield record
    finally:
        _records.pop()
