"""One measured point of a stability sweep."""

from __future__ import annotations

import math
from dataclasses import dataclass

COLUMNS = ("case", "parameter", "value", "naive_error", "error", "bound", "verdict")


@dataclass(frozen=True)
class Row:
    """``error`` of lfcore and ``naive_error`` of a textbook float32 method beside it.

    The bound is set before the measurement and in the unit that the case states.  The verdict
    is ``refused`` when lfcore raised one of its errors rather than compute, which is right
    outside the documented range; then ``error`` is NaN.  ``condition`` is the largest condition
    number of the problem at this value, relative change of the answer over that of the input; NaN
    where the answer is a choice and has none.
    """

    case: str
    parameter: str
    value: float
    naive_error: float
    error: float
    bound: float
    refused: bool = False
    condition: float = math.nan

    @property
    def verdict(self) -> str:
        if self.refused:
            return "refused"
        return "pass" if math.isfinite(self.error) and self.error <= self.bound else "fail"

    def as_dict(self) -> dict[str, object]:
        """By the names of :data:`COLUMNS`."""
        return {name: getattr(self, name) for name in COLUMNS}
