"""A measured method, and one run of it."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.util import find_spec

from lfcore import timing


class SkippedError(Exception):
    """This method cannot run here; the message says what is missing."""


def check_installed(*packages: str) -> None:
    """Raise :class:`SkippedError` for packages that are not installed."""
    missing = [name.replace("_", "-") for name in packages if find_spec(name) is None]
    if missing:
        raise SkippedError(f"not installed: pip install {' '.join(missing)}")


@dataclass(frozen=True)
class Run:
    """One run: wall seconds, CPU seconds of all threads, rays."""

    seconds: float
    cpu_seconds: float
    rays: int


@dataclass
class Method:
    """A named piece of work that can be run again and again.

    ``run`` does the work once.  ``note`` has what a reader needs to compare: threads, instruction
    set, differences.  ``check`` returns (share of rays that hit, their mean depth), or None if they
    are unknown.
    """

    name: str
    work: str
    run: Callable[[], Run]
    note: str = ""
    check: Callable[[], tuple[float, float] | None] = lambda: None
    ours: bool = False
    extra: dict = field(default_factory=dict)


def clocked(work: Callable[[], object], rays: int) -> Run:
    """Run ``work`` in this process under both clocks."""
    (_, cpu), wall = timing.clocked(lambda: timing.clocked(work, clock=time.process_time))
    return Run(wall, cpu, rays)
