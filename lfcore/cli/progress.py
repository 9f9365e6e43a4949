"""A line of progress on standard error."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from lfcore.opencl.program_cache import watching

WIDTH = 24
INTERVAL_S = 0.2


@contextmanager
def progress(what: str, unit: str = "") -> Iterator[Callable[[int, int], None]]:
    """Yield ``report(done, total)``, which draws a bar; ends with a line of how long it took.

    While OpenCL programs are built the line says so, and the last line how long that took.  Where
    standard error is no terminal, only that last line is written.
    """
    begun, last, live = time.perf_counter(), 0.0, sys.stderr.isatty()
    builds = _Builds(lambda text: _draw(text or f"{what} ...") if live else None)

    def report(done: int, total: int) -> None:
        nonlocal last
        now = time.perf_counter()
        if not live or (now - last < INTERVAL_S and done < total):
            return
        last, share = now, done / max(total, 1)
        left = (now - begun - builds.seconds) * (1 - share) / share if share else 0.0
        bar = "#" * round(share * WIDTH)
        _draw(f"{what} [{bar:<{WIDTH}}] {done}/{total} {unit}, {left:.0f} s left ")

    with watching(builds):
        yield report
    line = f"{what}: {time.perf_counter() - begun:.1f} s"
    if builds.seconds >= 0.1:
        line += f", {builds.seconds:.1f} s of them building kernels"
    print(f"\r{line:<90}" if live else line, file=sys.stderr)


def _draw(text: str) -> None:
    print(f"\r{text:<90}", end="", file=sys.stderr, flush=True)


class _Builds:
    """Counts seconds in which some thread builds, and has ``draw`` say so; "" when it is over."""

    def __init__(self, draw: Callable[[str], None]):
        self.draw, self.seconds = draw, 0.0
        self._building, self._since, self._lock = 0, 0.0, threading.Lock()

    def __call__(self, begins: bool) -> None:
        with self._lock:
            self._building += 1 if begins else -1
            if begins and self._building == 1:
                self._since = time.perf_counter()
                self.draw("building kernels ...")
            elif not self._building:
                self.seconds += time.perf_counter() - self._since
                self.draw("")


def say(text: str) -> None:
    """A line on standard error."""
    print(text, file=sys.stderr)
