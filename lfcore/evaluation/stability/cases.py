"""All cases in the order of the report: what each is, in what unit its error is, and where its
bound comes from.

The bounds stand in the cases with their reasons here; none was taken from a measurement.
"""

from __future__ import annotations

import difflib
import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from lfcore.evaluation.stability import (
    codecs,
    edges,
    extents,
    hostile,
    lenses,
    primitives,
    shadows,
)
from lfcore.evaluation.stability.measurement import Case, Measurement, StabilityError
from lfcore.evaluation.stability.tested_tracer import TracerUnderTest
from lfcore.progress import Progress, silent

CASES: tuple[Case, ...] = (
    *edges.CASES,
    *extents.CASES,
    *primitives.CASES,
    *hostile.CASES,
    *shadows.CASES,
    *lenses.CASES,
    *codecs.CASES,
)

CHOICE = "share of rays"
CODES = "8-bit codes, rms"
DEPTH = "2^-24 of the depth, over the condition number"
NONE_MAY = "a choice is right or wrong; rays within 16 ulp of an edge or tie have none"
SIXTEEN = "16 roundings lead from the corners to a depth, each amplified by the condition number"


@dataclass(frozen=True)
class Description:
    """``case`` is how the names of its rows begin; ``number`` counts among the twenty cases of the
    specification, where there is one."""

    case: str
    number: str
    unit: str
    bound_from: str


# Cases of hits have two rows each: the triangle, and its depth.
HITS = {
    "blocks: triangle size": "8",
    "blocks: lens samples": "18",
    "long rays": "4",
    "tiny triangles": "8",
    "large triangles": "8",
    "scaled scene": "12, 13",
    "needles": "7",
    "grazing": "9",
}
OTHERS = (
    ("edge rays", "1", "share of rays that leak", "a closed mesh has no gaps"),
    ("vertex rays", "2", "share of rays that leak", "a closed mesh has no gaps"),
    ("lens on a vertex", "2", "share of rays that leak", "a wall has no gaps"),
    ("far from the origin", "3", DEPTH, SIXTEEN + "; world coordinates are float64"),
    ("far sphere", "16", DEPTH, SIXTEEN),
    ("no area", "7", CHOICE, "what has no area is never met"),
    ("nearly coplanar", "15", CHOICE, "16 ulp, the bound of a depth, part two of them"),
    ("axis directions", "10", CHOICE, "no direction is special"),
    ("flat boxes", "11", "share of rays lost", "a box holds its corners"),
    ("coplanar copies", "15", CHOICE, "of equal depths the lowest number wins"),
    ("invalid rays (time)", "14", "seconds over those of sound rays", "Embree's own bound"),
    ("invalid rays", "14", CHOICE, "rays do not know of each other"),
    ("invalid triangles", "14", CHOICE, "what is not finite is never met"),
    ("self-shadow", "5", "share of pixels", "a convex body does not shade itself"),
    ("thin gap", "6", "share of pixels", "to 16 ulp of the distance; 32 ulp where it varies"),
    ("beyond the slab", "18", "lens samples", "a whole number"),
    ("near the focal length", "17", "2^-24 of the distance", "three roundings, none cancels"),
    ("focus to infinity", "18", "2^-24 rad", "three roundings of a direction"),
    ("apertures", "18", "2^-24 rad", "three roundings of a direction"),
    ("refocus shifts", "19", "pixels", "a thousandth of a pixel is nowhere seen"),
    ("accumulation", "20", "8-bit codes", "a thousandth of a code; sums are whole numbers"),
    ("codec 4:4:4 lossless", "codec", CODES, "rounding of Y, Cb and Cr to 8 bits"),
    ("codec 4:2:0 lossy, black", "codec", CODES, "key frames' quantiser"),
    ("codec 4:2:0 lossy, white", "codec", CODES, "key frames' quantiser"),
    ("codec 4:2:0 lossy", "codec", CODES, "B frames' quantiser at CRF 22"),
)
DESCRIPTIONS = (
    *(Description(f"{case} (triangle)", k, CHOICE, NONE_MAY) for case, k in HITS.items()),
    *(Description(f"{case} (depth)", k, DEPTH, SIXTEEN) for case, k in HITS.items()),
    *itertools.starmap(Description, OTHERS),
)


def description(case: str) -> Description:
    """Of a row's case; KeyError for a case without one."""
    for one in DESCRIPTIONS:
        if case.startswith(one.case):
            return one
    raise KeyError(f"{case!r} has no description")


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
    tracer: TracerUnderTest,
    cases: Sequence[Case] = CASES,
    *,
    progress: Progress = silent,
) -> list[Measurement]:
    """Measurements of these cases; ``progress(done, total)`` counts cases."""
    made: list[Measurement] = []
    for number, case in enumerate(cases, 1):
        made.extend(case(tracer))
        progress(number, len(cases))
    return made
