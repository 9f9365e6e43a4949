"""A line of progress on standard error."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from lfcore.opencl.program_cache import watching

WIDTH = 24
INTERVAL_S = 0.2


@contextmanager
def progress(what: str, unit: str = "") -> Iterator[Callable[[int, int], None]]:
    """Yield ``report(done, total)``, which draws a bar; ends with a line of how long it took.

    Says so while a program is built, which comes before the first step.  Where standard error is
    no terminal, only that last line is written.
    """
    begun, last, live = time.perf_counter(), 0.0, sys.stderr.isatty()

    def report(done: int, total: int) -> None:
        nonlocal last
        now = time.perf_counter()
        if not live or (now - last < INTERVAL_S and done < total):
            return
        last, share = now, done / max(total, 1)
        left = (now - begun) * (1 - share) / share if share else 0.0
        bar = "#" * round(share * WIDTH)
        text = f"\r{what} [{bar:<{WIDTH}}] {done}/{total} {unit}, {left:.0f} s left "
        print(f"{text:<90}", end="", file=sys.stderr, flush=True)

    def building() -> None:
        if live:
            print(f"\r{f'{what}: building kernels ...':<90}", end="", file=sys.stderr, flush=True)

    with watching(building):
        yield report
    start = "\r" if live else ""
    line = f"{what}: {time.perf_counter() - begun:.1f} s"
    print(f"{start}{line:<90}".rstrip(" ") if not live else f"{start}{line:<90}", file=sys.stderr)


def say(text: str) -> None:
    """A line on standard error."""
    print(text, file=sys.stderr)
