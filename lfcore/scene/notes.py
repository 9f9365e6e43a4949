"""Notes on differences between a file and its scene, with file and line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from lfcore.errors import printable

KINDS = LEFT_OUT, APPROXIMATED, NOT_USED, ASSUMED = (
    "left out", "approximated", "not used", "assumed"
)  # fmt: skip


def first_instant(start_s: float, end_s: float) -> str:
    """The words about a scene that moves."""
    return f"it moves from {start_s:g} to {end_s:g} s, shown is the first instant; .at() has others"


class Place(Protocol):
    """A line of a file, as readers have it."""

    @property
    def file(self) -> Path: ...

    @property
    def line(self) -> int: ...


@dataclass(frozen=True)
class Note:
    """One difference between a scene and its file.

    Parameters
    ----------
    kind : str
        :data:`LEFT_OUT` (missing from the picture), :data:`APPROXIMATED` (replaced by the most
        similar thing), :data:`NOT_USED` (without a meaning here, such as pbrt's sampler) or
        :data:`ASSUMED` (a choice, with its alternative).
    file : Path
        The file.
    line : int
        The line, from 1; 0 is the whole file.
    what : str
        The difference.
    """

    kind: str
    file: Path
    line: int
    what: str

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}" if self.line else str(self.file)
        return printable(f"{place}: {self.kind}: {self.what}")


@dataclass(frozen=True)
class Count:
    """The number of things of a kind in a file.

    Attributes
    ----------
    file : Path
        The file.
    what : str
        The things.
    held, used : int
        Their number in the file, and in the scene.
    """

    file: Path
    what: str
    held: int
    used: int

    def __str__(self) -> str:
        unused = "" if self.used == self.held else f" ({self.used or 'none'} used)"
        return f"{self.held:,} {self.what}{unused}"


class Notebook:
    """Collects notes while a scene is read; the same words at the same line count once.

    ``counts`` has the account of each file.
    """

    def __init__(self) -> None:
        self._notes: dict[Note, None] = {}
        self.counts: dict[Path, tuple[Count, ...]] = {}

    def add(self, kind: str, place: Place | Path, what: str) -> None:
        """Add a note on a place, or on a whole file."""
        file, line = (place, 0) if isinstance(place, Path) else (place.file, place.line)
        self._notes.setdefault(Note(kind, file, line, what))

    def notes(self) -> tuple[Note, ...]:
        return tuple(self._notes)
