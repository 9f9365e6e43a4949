"""The callback by which long work reports its progress."""

from collections.abc import Callable

Progress = Callable[[int, int], None]
"""Called with (done, of all), from any thread but one at a time."""


def silent(done: int, total: int) -> None:
    """Report nothing."""
