"""How published seconds are measured.

Two kinds, never mixed in one table.  :class:`Stopwatch` adds up the wall seconds of the parts of
one long job, which runs once.  :func:`measure` repeats a short piece of work: warm-up runs,
then the median of several, with the spread.  Both need the work to be over when the clock is
read: ``finish`` is called before each reading and waits for the device's queue.
"""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Timing:
    """Wall seconds of repeated runs of the same work, in order of running."""

    seconds: tuple[float, ...]

    @property
    def median(self) -> float:
        return float(np.median(self.seconds))

    @property
    def quartiles(self) -> tuple[float, float]:
        """First and third quartile, seconds; their difference is the spread to report."""
        low, high = np.percentile(self.seconds, (25, 75))
        return float(low), float(high)

    def to_json(self) -> dict:
        low, high = self.quartiles
        return {
            "median_seconds": self.median,
            "quartile_1_seconds": low,
            "quartile_3_seconds": high,
            "repeats": len(self.seconds),
        }


def measure(
    work: Callable[[], object],
    *,
    repeats: int = 5,
    warm_up: int = 1,
    finish: Callable[[], object] = lambda: None,
    clock: Callable[[], float] = time.perf_counter,
) -> Timing:
    """Run ``work`` ``warm_up`` times unseen, then ``repeats`` times under the clock.

    Parameters
    ----------
    finish : waits for what ``work`` has left running (``queue.finish``); inside the time.
    clock : seconds, monotonic.

    Raises
    ------
    ValueError
        when ``repeats`` is less than 1.
    """
    if repeats < 1:
        raise ValueError(f"repeats must be at least 1, not {repeats}")
    for _ in range(warm_up):
        work()
    seconds = []
    for _ in range(repeats):
        finish()
        start = clock()
        work()
        finish()
        seconds.append(clock() - start)
    return Timing(tuple(seconds))


@dataclass
class Stopwatch:
    """Wall seconds of the named parts of a job.

    >>> watch = Stopwatch()
    >>> with watch.part("encode"):
    ...     pass
    >>> sorted(watch.seconds)
    ['encode']
    """

    seconds: dict[str, float] = field(default_factory=dict)
    clock: Callable[[], float] = time.perf_counter

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Add the time of the block to part ``name``, also when the block raises."""
        start = self.clock()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + self.clock() - start

    def each(self, name: str, items: Iterator) -> Iterator:
        """Yield from ``items``, counting the time it takes to make each item to ``name``."""
        items = iter(items)
        while True:
            with self.part(name):
                try:
                    item = next(items)
                except StopIteration:
                    return
            yield item


def machine() -> dict[str, str | int]:
    """What stands beside every published second: processor, cores, memory, system, Python."""
    return {
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0))
        if hasattr(os, "sched_getaffinity")
        else os.cpu_count(),
        "memory_gib": round(_memory_bytes() / 2**30),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
    }


def _processor(cpuinfo: Path = Path("/proc/cpuinfo")) -> str:
    try:
        for line in cpuinfo.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _memory_bytes() -> int:
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return 0
