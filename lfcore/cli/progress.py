"""What a command tells while it runs: a line of progress and remarks, or a record for programs.

Everything here goes to standard error.  Within :func:`recorded` nothing is printed; what would have
been is kept, and :class:`lfcore.cli.command.Command` prints it as one JSON object (``--json``).
"""

from __future__ import annotations

import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from lfcore.opencl.program_cache import watching
from lfcore.timing import duration

WIDTH = 24
INTERVAL_S = 0.2
SHORTEST_S = 0.05
"""Over less no rate is told: it would be the clock's."""
_records: list[dict[str, Any]] = []


@contextmanager
def progress(what: str, unit: str = "", *, rays: int = 0) -> Iterator[Callable[[int, int], None]]:
    """Yield ``report(done, total)``, which draws a bar; ends with a line of how long it took.

    ``rays`` are traced in all: their rate is told then, and not how many units are done.  While
    OpenCL programs are built the line says so, and the last line how long that took; neither rate
    nor time left counts those seconds.  Where standard error is no terminal, only the last line is
    written.
    """
    step = _Step(what, unit, rays, live=sys.stderr.isatty() and not _records)
    with watching(step.building):
        yield step.report
    step.end()


class _Step:
    """One thing that takes a while; threads report, and build."""

    def __init__(self, what: str, unit: str, rays: int, live: bool):
        self.what, self.unit, self.rays, self.live = what, unit, rays, live
        self.begun, self.drawn = time.perf_counter(), 0.0
        self._built, self._builders, self._since, self._lock = 0.0, 0, 0.0, threading.Lock()

    def building(self, begins: bool) -> None:
        """Some thread begins to build a program, or has."""
        with self._lock:
            self._builders += 1 if begins else -1
            if begins and self._builders == 1:
                self._since = time.perf_counter()
                self._draw("building kernels ...")
            elif not self._builders:
                self._built += time.perf_counter() - self._since
                self._draw(f"{self.what} ...")

    def report(self, done: int, total: int) -> None:
        with self._lock:
            now = time.perf_counter()
            # What is being built holds up the rest, and the line says so until it is there.
            if self._builders or (now - self.drawn < INTERVAL_S and done < total):
                return
            self.drawn, share = now, min(1.0, done / max(total, 1))
            worked = now - self.begun - self._built
            left = f", {duration(worked * (1 - share) / share)} left" if share else ""
            state = f"{done}/{total} {self.unit}"
            if self.rays:
                state = f"{100 * share:.0f}%{_rate(self.rays * share, worked)}"
            self._draw(f"{self.what} [{'#' * round(share * WIDTH):<{WIDTH}}] {state}{left}")

    def end(self) -> None:
        """The last line, or a step of the record."""
        seconds = time.perf_counter() - self.begun
        if _records:
            found = {"what": self.what, "seconds": round(seconds, 3)}
            found["building_kernels_seconds"] = round(self._built, 3)
            if self.rays:
                found |= {"rays": self.rays}
                if seconds - self._built > SHORTEST_S:
                    found["rays_per_second"] = round(self.rays / (seconds - self._built))
            _records[-1]["steps"].append(found)
            return
        line = f"{self.what}: {seconds:.1f} s"
        if self._built >= 0.1:
            line += f", {self._built:.1f} s of them building kernels"
        line += _rate(self.rays, seconds - self._built)
        if self.live:
            self._draw(line)
        print("" if self.live else line, file=sys.stderr)

    def _draw(self, text: str) -> None:
        if self.live:
            # A line that is broken cannot be drawn over.
            room = max(shutil.get_terminal_size((91, 24))[0] - 1, 20)
            print(f"\r{text[:room]:<{min(room, 90)}}", end="", file=sys.stderr, flush=True)


def _rate(rays: float, seconds: float) -> str:
    if not rays or seconds < SHORTEST_S:
        return ""
    return f", {rays / seconds / 1e6:.3g} million rays a second"


def say(text: str) -> None:
    """A line on standard error."""
    if _records:
        _records[-1]["said"].append(text)
    else:
        print(text, file=sys.stderr)


def wrote(path: Path, more: str = "") -> None:
    """Say that a file was written."""
    if _records:
        _records[-1]["files"].append({"file": str(path), "bytes": path.stat().st_size})
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
