"""Progress of long work: a callback, and the stages that may come first."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

Progress = Callable[[int, int], None]
"""Called with (done, of all), from any thread but one at a time."""
BUILDING, BAKING = "building kernels", "baking light"
_watchers: list[Callable[[str, bool], None]] = []


def part_of(progress: Progress | None, number: int, parts: int) -> Progress | None:
    """The progress of part ``number`` of several, as a part of all."""
    return progress and (lambda done, of: progress(number * of + done, parts * of))


@contextmanager
def watching(tell: Callable[[str, bool], None]) -> Iterator[None]:
    """Call ``tell(name, True)`` before a stage, and ``tell(name, False)`` after it.

    Stages may be within one another, and several threads may be in one at a time.
    """
    _watchers.append(tell)
    try:
        yield
    finally:
        _watchers.remove(tell)


@contextmanager
def stage(name: str) -> Iterator[None]:
    """Tell watchers that the block is a stage, :data:`BUILDING` or :data:`BAKING`."""
    told = list(_watchers)
    for tell in told:
        tell(name, True)
    try:
        yield
    finally:
        for tell in told:
            tell(name, False)
