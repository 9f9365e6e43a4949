"""How published seconds are measured.

Every published second comes from here.  :class:`Stopwatch` and :func:`clocked` are for long work,
which runs once.  :func:`measure_in_turn` and :func:`measure_within` repeat short work: the median
of several runs, with the spread.  All need the work to be over when the clock is
read: no device's queue may be left unfinished.
"""

import os
import platform
import re
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import numpy as np

Result = TypeVar("Result")

SHORT_SECONDS = 0.2
"""Work of fewer seconds is timed again: the first run's overhead would show."""


@dataclass(frozen=True)
class Timing:
    """Seconds of repeated runs of the same work, in order of running."""

    seconds: tuple[float, ...]

    @property
    def median(self) -> float:
        return float(np.median(self.seconds))

    @property
    def quartiles(self) -> tuple[float, float]:
        """First and third quartile, seconds; their difference is the spread to report."""
        low, high = np.percentile(self.seconds, (25, 75))
        return float(low), float(high)


def clocked(
    work: Callable[[], Result], *, clock: Callable[[], float] = time.perf_counter
) -> tuple[Result, float]:
    """What one run of ``work`` returns, and its seconds.

    For work that lasts long enough to be run once.
    """
    start = clock()
    result = work()
    return result, clock() - start


def clocked_warm(
    work: Callable[[], Result],
    programs: Callable[[], int],
    *,
    clock: Callable[[], float] = time.perf_counter,
) -> tuple[Result, float]:
    """As :func:`clocked`, of the second run where the first is short or made ``programs``, which
    counts those that this process has built or read."""
    result, timing = measure_within(work, SHORT_SECONDS, programs, repeats=1, clock=clock)
    return result, timing.median


def measure_in_turn(
    works: Sequence[Callable[[], object]],
    *,
    repeats: int,
    clock: Callable[[], float] = time.perf_counter,
) -> list[Timing]:
    """Pieces of work that take turns under the clock.

    What slows the machine for a while slows all of them.
    """
    seconds: list[list[float]] = [[] for _ in works]
    for _ in range(repeats):
        for work, taken in zip(works, seconds, strict=True):
            taken.append(clocked(work, clock=clock)[1])
    return [Timing(tuple(taken)) for taken in seconds]


def measure_within(
    work: Callable[[], Result],
    budget_seconds: float,
    programs: Callable[[], int],
    *,
    repeats: int,
    clock: Callable[[], float] = time.perf_counter,
) -> tuple[Result, Timing]:
    """The result of ``work``, and seconds of its repeats: ``repeats`` where it is short, as often
    as the budget allows else.

    The first run counts where it is longer than its share of the budget and built no programs.
    """
    before = programs()
    result, first = clocked(work, clock=clock)
    counts = first > budget_seconds / repeats and programs() == before
    seconds = [first] if counts else []
    while len(seconds) < repeats and not (seconds and sum(seconds) + min(seconds) > budget_seconds):
        result, taken = clocked(work, clock=clock)
        seconds.append(taken)
    return result, Timing(tuple(seconds))


@dataclass
class Stopwatch:
    """Seconds of the named parts of a job, wall seconds unless ``clock`` is another.

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

    def each(self, name: str, items: Iterable[Result]) -> Iterator[Result]:
        """Yield from ``items``, counting the time it takes to make each item to ``name``."""
        rest = iter(items)
        while True:
            with self.part(name):
                try:
                    item = next(rest)
                except StopIteration:
                    return
            yield item


def machine() -> dict[str, str | int]:
    """What stands beside every published second: processor, cores, memory, system, Python."""
    cpuinfo = Path("/proc/cpuinfo")  # of Linux
    text = cpuinfo.read_text(encoding="utf-8", errors="replace") if cpuinfo.is_file() else ""
    model = re.search(r"^model name\s*: *(.*\S)", text, re.MULTILINE)
    return {
        "processor": model[1] if model else platform.processor() or platform.machine(),
        "cores": processors(),
        "memory_gib": round(memory_bytes() / 2**30),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
    }


def processors() -> int:
    """Processors that this process may use; all there are where the system does not say."""
    if hasattr(os, "sched_getaffinity"):  # not on macOS, nor on Windows
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def memory_bytes() -> int:
    """The machine's memory, bytes; 0 where the system does not report it."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return 0
