"""What each case is, in what unit its error is, and where its bound comes from.

The bounds stand here with their reasons; none was taken from a measurement.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import pandas as pd

from lfcore.evaluation.stability.rows import Row

CHOICE = "share of rays"
DEPTH = "2^-24 of the depth, over the condition number"
NONE_MAY = "a choice is right or wrong; rays within 16 ulp of an edge or tie have none"
SIXTEEN = "16 roundings lead from the corners to a depth, each amplified by the condition number"


@dataclass(frozen=True)
class About:
    """``case`` is how the names of its rows begin; ``number`` counts among the twenty cases of the
    specification, where there is one."""

    case: str
    number: str
    unit: str
    reason: str


ABOUT = (
    About("edge rays", "1", "share of rays that leak", "a closed mesh has no gaps"),
    About("vertex rays", "2", "share of rays that leak", "a closed mesh has no gaps"),
    About("lens on a vertex", "2", "share of rays that leak", "a wall has no gaps"),
    About("blocks: triangle size (triangle)", "8", CHOICE, NONE_MAY),
    About("blocks: triangle size (depth)", "8", DEPTH, SIXTEEN),
    About("blocks: lens samples (triangle)", "18", CHOICE, NONE_MAY),
    About("blocks: lens samples (depth)", "18", DEPTH, SIXTEEN),
    About("far from the origin", "3", DEPTH, SIXTEEN + "; world coordinates are float64"),
    About("long rays (triangle)", "4", CHOICE, NONE_MAY),
    About("long rays (depth)", "4", DEPTH, SIXTEEN),
    About("tiny triangles (triangle)", "8", CHOICE, NONE_MAY),
    About("tiny triangles (depth)", "8", DEPTH, SIXTEEN),
    About("large triangles (triangle)", "8", CHOICE, NONE_MAY),
    About("large triangles (depth)", "8", DEPTH, SIXTEEN),
    About("scaled scene (triangle)", "12, 13", CHOICE, NONE_MAY),
    About("scaled scene (depth)", "12, 13", DEPTH, SIXTEEN),
    About("far sphere", "16", DEPTH, SIXTEEN),
    About("needles (triangle)", "7", CHOICE, NONE_MAY),
    About("needles (depth)", "7", DEPTH, SIXTEEN),
    About("no area", "7", CHOICE, "what has no area is never met"),
    About("nearly coplanar", "15", CHOICE, "16 ulp, the bound of a depth, part two of them"),
    About("grazing (triangle)", "9", CHOICE, NONE_MAY),
    About("grazing (depth)", "9", DEPTH, SIXTEEN),
    About("axis directions", "10", CHOICE, "no direction is special"),
    About("flat boxes", "11", "share of rays lost", "a box holds its corners"),
    About("coplanar copies", "15", CHOICE, "of equal depths the lowest number wins"),
    About("invalid rays (time)", "14", "seconds over those of sound rays", "Embree's own bound"),
    About("invalid rays", "14", CHOICE, "rays do not know of each other"),
    About("invalid triangles", "14", CHOICE, "what is not finite is never met"),
    About("self-shadow", "5", "share of pixels", "a convex body does not shade itself"),
    About("thin gap", "6", "share of pixels", "to 16 ulp of the distance; 32 ulp where it varies"),
    About("beyond the slab", "18", "lens samples", "a whole number"),
    About("near the focal length", "17", "2^-24 of the distance", "three roundings, none cancels"),
    About("focus to infinity", "18", "2^-24 rad", "three roundings of a direction"),
    About("apertures", "18", "2^-24 rad", "three roundings of a direction"),
    About("refocus shifts", "19", "pixels", "a thousandth of a pixel is nowhere seen"),
    About("accumulation", "20", "8-bit codes", "a thousandth of a code; sums are whole numbers"),
    About(
        "codec 4:4:4 lossless", "codec", "8-bit codes, rms", "rounding of Y, Cb and Cr to 8 bits"
    ),
    About("codec 4:2:0 lossy, black", "codec", "8-bit codes, rms", "key frames' quantiser"),
    About("codec 4:2:0 lossy, white", "codec", "8-bit codes, rms", "key frames' quantiser"),
    About("codec 4:2:0 lossy", "codec", "8-bit codes, rms", "B frames' quantiser at CRF 22"),
)
COLUMNS = (
    "case", "number", "parameter", "least", "most", "condition_number", "unit", "bound",
    "bound_from", "naive_worst", "worst", "passed", "refused", "failed",
)  # fmt: skip


def about(case: str) -> About:
    """The entry of a row's case; KeyError for a case without one."""
    for entry in ABOUT:
        if case.startswith(entry.case):
            return entry
    raise KeyError(f"{case!r} has no entry in ABOUT")


def cases_table(rows: list[Row]) -> pd.DataFrame:
    """A row a case: its sweep, largest condition number, bound and where that comes from."""
    made = []
    for case in dict.fromkeys(row.case for row in rows):
        entry, some = about(case), [row for row in rows if row.case == case]
        known = [row.condition for row in some if not math.isnan(row.condition)]
        verdicts = [row.verdict for row in some]
        made.append(
            {
                "case": case,
                "number": entry.number,
                "parameter": some[0].parameter,
                "least": min(row.value for row in some),
                "most": max(row.value for row in some),
                "condition_number": max(known) if known else None,
                "unit": entry.unit,
                "bound": max(row.bound for row in some),
                "bound_from": entry.reason,
                "naive_worst": max(row.naive_error for row in some),
                "worst": max((row.error for row in some if not row.said), default=None),
                "passed": verdicts.count("pass"),
                "refused": verdicts.count("refused"),
                "failed": verdicts.count("fail"),
            }
        )
    return pd.DataFrame(made, columns=list(COLUMNS))
