"""One measurement of a stability sweep, what its verdict follows from, and how cases make them."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple, SupportsFloat

import numpy as np

from lfcore.errors import LfcoreError, OpticsError, SceneError
from lfcore.evaluation.stability.tested_tracer import TracerUnderTest

COLUMNS = ("case", "parameter", "value", "naive_error", "error", "bound", "verdict", "limit")
LIMITS = {
    "coordinates": "out of range",
    "small triangles": "too small",
    "focus": "inside the focal length",
    "apertures": "wider than the lens",
}
"""The documented limits (``docs/stability.md``), and what the program says beyond each."""
NO_ANSWER = math.inf
"""Error of a method that gives no number, or no picture: larger than any that can be measured."""


class StabilityError(LfcoreError):
    """A stability sweep in which a measurement fails."""


class Bound(NamedTuple):
    """The largest ``error`` that passes, its ``unit``, and the ``reason``: never a measurement."""

    error: float
    unit: str
    reason: str


CHOICE = "share of rays"
RIGHT = Bound(
    0, CHOICE, "a choice is right or wrong; rays within 16 ulp of an edge or tie have none"
)
DEPTH = Bound(
    16,
    "2^-24 of the depth, over the condition number",
    "16 roundings lead from the corners to a depth, each amplified by the condition number",
)


@dataclass(frozen=True)
class Measurement:
    """``error`` of lfcore and ``naive_error`` of a textbook float32 method beside it.

    The bound is set before the measurement, with its ``unit`` and ``bound_from``, its reason.  So
    is ``limit``: the name in :data:`LIMITS` of the documented limit beyond which the value lies, or
    nothing.  ``said`` is the program's refusal, where it refused; then ``error`` is NaN.
    ``condition`` is the largest condition number of the problem at this value, relative change of
    the answer over that of the input; NaN where the answer is a choice and has none.  ``number`` is
    that of the :class:`Case`.
    """

    case: str
    parameter: str
    value: float
    naive_error: float
    error: float
    bound: float
    limit: str = ""
    said: str = ""
    condition: float = math.nan
    unit: str = ""
    bound_from: str = ""
    number: str = ""

    @property
    def verdict(self) -> str:
        """``refused``: beyond a limit, and the program named that limit.

        To refuse within all limits, to name another limit, and to compute beyond one is to fail.
        """
        if self.limit:
            return "refused" if re.search(LIMITS[self.limit], self.said) else "fail"
        if self.said:
            return "fail"
        return "pass" if math.isfinite(self.error) and self.error <= self.bound else "fail"

    def as_dict(self) -> dict[str, object]:
        """All fields, and the verdict."""
        return {**vars(self), "verdict": self.verdict}

    def __str__(self) -> str:
        found = f"said {self.said!r}" if self.said else f"error {self.error:g}"
        beyond = f", beyond the limit of {self.limit}" if self.limit else ""
        return (
            f"{self.case}, {self.parameter} = {self.value:g}{beyond}: {found}, bound {self.bound:g}"
        )


@dataclass(frozen=True, eq=False)
class Case:
    """A sweep: ``measure(tracer, value)`` makes one measurement at a value, or several.

    ``parameter`` is the name of the values, with their unit; ``number`` counts among the twenty
    cases of the specification, or is ``codec``.
    """

    measure: Callable
    number: str
    parameter: str
    values: Iterable[float]

    @property
    def name(self) -> str:
        return self.measure.__name__

    def __call__(self, tracer: TracerUnderTest) -> Iterator[Measurement]:
        number, parameter = self.number, self.parameter
        for value in self.values:
            found = self.measure(tracer, value)
            for one in [found] if isinstance(found, Measurement) else found:
                yield replace(one, number=number, parameter=parameter, value=float(value))


def sweep(number: str, parameter: str, values: Iterable[float]) -> Callable[[Callable], Case]:
    """The :class:`Case` of the function below."""
    return lambda measure: Case(measure, number, parameter, values)


def measured(
    case: str,
    bound: Bound,
    naive: Callable[[], SupportsFloat],
    ours: Callable[[], SupportsFloat],
    *,
    limit: str = "",
    condition: float = math.nan,
) -> Measurement:
    """Of two callables that give an error each; ``ours`` may refuse a scene or a lens.

    Any other error, such as a device's or a file's, is no refusal and passes through.
    """
    with np.errstate(all="ignore"):
        naive_error, error, said = float(naive()), math.nan, ""
        try:
            error = float(ours())
        except (SceneError, OpticsError) as refusal:
            said = str(refusal)
    largest, unit, reason = bound
    return Measurement(
        case, "", math.nan, naive_error, error, float(largest), limit, said, float(condition),
        unit, reason,
    )  # fmt: skip


def check_passed(measurements: Iterable[Measurement]) -> None:
    """Raises :class:`StabilityError` that names the measurements that fail."""
    failed = [str(one) for one in measurements if one.verdict == "fail"]
    if failed:
        raise StabilityError(
            f"{len(failed)} rows of the stability sweeps fail: {'; '.join(failed[:20])}",
            remedy="What they test, and where their bounds come from, is in docs/stability.md",
        )
