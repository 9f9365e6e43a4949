"""The callback by which long work reports its progress."""

from collections.abc import Callable

Progress = Callable[[int, int], None]
"""Called with (done, of all), from any thread but one at a time."""


def part_of(progress: Progress | None, number: int, parts: int) -> Progress | None:
    """The progress of part ``number`` of several, as a part of all."""
    return progress and (lambda done, of: progress(number * of + done, parts * of))
