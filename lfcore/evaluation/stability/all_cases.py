"""All cases in the order of the report."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Iterator, Sequence

from lfcore.evaluation.stability import (
    blocks,
    codecs,
    edges,
    extents,
    hostile,
    lenses,
    primitives,
    shadows,
    sums,
)
from lfcore.evaluation.stability.rows import Row, StabilityError
from lfcore.evaluation.stability.subject import Subject

Case = Callable[[Subject], Iterator[Row]]

CASES: tuple[Case, ...] = (
    *edges.CASES,
    *blocks.CASES,
    *extents.CASES,
    *primitives.CASES,
    *hostile.CASES,
    *shadows.CASES,
    *lenses.CASES,
    *sums.CASES,
    *codecs.CASES,
)


def chosen(names: str | Iterable[str]) -> tuple[Case, ...]:
    """The cases of these names, or ``all``.

    Raises :class:`StabilityError` for a name that no case has.
    """
    known = {case.__name__: case for case in CASES}
    if names == "all":
        return CASES
    for name in names:
        if name not in known:
            close = difflib.get_close_matches(name, known, 1)
            remedy = f"Did you mean {close[0]!r}" if close else f"Cases are {', '.join(known)}"
            raise StabilityError(
                f"no stability sweep is called {name!r}",
                key="analysis.stability_cases",
                remedy=remedy,
            )
    return tuple(known[name] for name in names)


def run_all(
    subject: Subject,
    cases: Sequence[Case] = CASES,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> list[Row]:
    """Rows of these cases; ``progress(done, total)`` counts cases."""
    rows: list[Row] = []
    for number, case in enumerate(cases, 1):
        rows.extend(case(subject))
        if progress:
            progress(number, len(cases))
    return rows
