"""All cases in the order of the report."""

from __future__ import annotations

from collections.abc import Callable, Iterator

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
from lfcore.evaluation.stability.rows import Row
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


def run_all(subject: Subject, *, progress: Callable[[int, int], None] | None = None) -> list[Row]:
    """Rows of every case; ``progress(done, total)`` counts cases."""
    rows: list[Row] = []
    for number, case in enumerate(CASES, 1):
        rows.extend(case(subject))
        if progress:
            progress(number, len(CASES))
    return rows
