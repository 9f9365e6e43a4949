"""One measurement of a stability sweep, its verdict, and functions for cases.

Errors of hits are against the oracle's, of the same float32 numbers.
"""

import functools
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple, SupportsFloat

import numpy as np

from lfcore.errors import LfcoreError, SceneError
from lfcore.evaluation.stability import naive
from lfcore.evaluation.stability.shapes import Rays
from lfcore.evaluation.stability.tested_tracer import ClosestHit, Found, TracerUnderTest, check_kept
from lfcore.oracle.crossings import ULP
from lfcore.oracle.intersect import Hits, closest_hits

COLUMNS = ["case", "parameter", "value", "naive_error", "error", "bound", "verdict", "limit"]
"""The columns that are published."""
LIMITS = {"coordinates": "out of range", "small triangles": "too small"}
"""The documented limits (``docs/stability.md``), and words of the error beyond each."""
NO_ANSWER = math.inf
"""The error of a method that gives no number."""


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
    """``error`` of lfcore, and ``naive_error`` of a textbook float32 method.

    ``bound`` has a ``unit`` and an origin, ``bound_from``.  ``limit`` is the name in :data:`LIMITS`
    of the documented limit that the value exceeds, or empty.  ``said`` is the text of the refusal;
    ``error`` is then NaN.  ``condition`` is the largest condition number of the problem at this
    value, the relative change of the answer over that of the input; NaN for a choice.
    ``number`` is the case's.
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
        """``pass``, ``refused`` or ``fail``.

        ``refused``: the value is beyond a limit, and the error named it.  A refusal within all
        limits, an error that names another limit, and a result beyond a limit fail.
        """
        if self.limit:
            return "refused" if LIMITS[self.limit] in self.said else "fail"
        if self.said:
            return "fail"
        return "pass" if math.isfinite(self.error) and self.error <= self.bound else "fail"

    def __str__(self) -> str:
        result = f"said {self.said!r}" if self.said else f"error {self.error:g}"
        beyond = f", beyond the limit of {self.limit}" if self.limit else ""
        step = f"{self.case}, {self.parameter} = {self.value:g}{beyond}"
        return f"{step}: {result}, bound {self.bound:g}"


Case = Callable[[TracerUnderTest], Iterator[Measurement]]


def sweep(number: str, parameter: str, values: Iterable[float]) -> Callable[[Callable], Case]:
    """Make a case from ``measure(tracer, value)``, which returns one or several measurements.

    ``parameter`` is the name of the values, with their unit; ``number`` counts among the twenty
    cases of the specification.
    """

    def case_of(measure: Callable) -> Case:
        @functools.wraps(measure)
        def case(tracer: TracerUnderTest) -> Iterator[Measurement]:
            for value in values:
                measurements = measure(tracer, value)
                for measurement in (
                    [measurements] if isinstance(measurements, Measurement) else measurements
                ):
                    yield replace(
                        measurement, number=number, parameter=parameter, value=float(value)
                    )

        return case

    return case_of


def measured(
    case: str,
    bound: Bound,
    by_naive: Callable[[], SupportsFloat],
    ours: Callable[[], SupportsFloat],
    *,
    limit: str = "",
    condition: float = math.nan,
) -> Measurement:
    """The measurement of two callables that return errors; ``ours`` may refuse a scene.

    Other exceptions, such as a device's or a file's, pass through.
    """
    with np.errstate(all="ignore"):
        naive_error, error, refusal_text = float(by_naive()), math.nan, ""
        try:
            error = float(ours())
        except SceneError as refusal:
            refusal_text = str(refusal)
    largest, unit, reason = bound
    return Measurement(
        case, "", math.nan, naive_error, error, float(largest), limit, refusal_text,
        float(condition), unit, reason,
    )  # fmt: skip


def leaks(traced: Found, hits: Hits) -> float:
    """Share of the rays that miss although the oracle hits."""
    ids = traced[0].ravel()
    return float(((ids < 0) & (hits.triangle >= 0)).mean())


def mismatches(traced: Found, hits: Hits, ulp: float = 16.0) -> float:
    """The share of wrong triangles among rays at least ``ulp`` from any edge or tie."""
    ids = traced[0].ravel()
    clear = hits.clear(ulp)
    return float((ids != hits.triangle)[clear].mean()) if clear.any() else 0.0


def depth_error(traced: Found, hits: Hits) -> float:
    """The largest error of t for right triangles: units of 2^-24 t, over the condition
    number 1 / sin of the incidence.  Infinite if any such t is not finite."""
    ids, t = (part.ravel() for part in traced)
    same = (ids == hits.triangle) & (ids >= 0)
    if not same.any():
        return 0.0
    with np.errstate(all="ignore"):
        error = np.abs(t[same] - hits.t[same]) / (hits.t * hits.grazing)[same] / ULP
    return float(np.where(np.isfinite(error), error, NO_ANSWER).max())


def condition_of_depth(hits: Hits) -> float:
    """The largest condition number of a depth: 1 / sin of the incidence; 1 without hits."""
    return float(hits.grazing[hits.triangle >= 0].max(initial=1.0))


def choice_and_depth(
    case: str,
    closest: ClosestHit,
    mesh: np.ndarray,
    rays: Rays,
    *,
    epsilon: float = 0.0,
    limit: str = "",
) -> Iterator[Measurement]:
    """Two measurements of the hits of ``closest``: the share of wrong triangles, and the depth.

    ``epsilon`` is Moeller and Trumbore's; ``limit`` is the one that the mesh exceeds.
    """
    hits = closest_hits(mesh, *rays)
    naive_found = naive.moeller_trumbore(mesh, *rays, epsilon=epsilon)

    @functools.cache
    def tested() -> Found:
        check_kept(mesh)
        return closest(mesh, *rays)

    def measurement(part: str, bound: Bound, error: Callable[[Found, Hits], float]) -> Measurement:
        return measured(
            f"{case} ({part})",
            bound,
            lambda: error(naive_found, hits),
            lambda: error(tested(), hits),
            limit=limit,
            condition=condition_of_depth(hits),
        )

    yield measurement("triangle", RIGHT, mismatches)
    yield measurement("depth", DEPTH, depth_error)


def check_passed(measurements: Iterable[Measurement]) -> None:
    """Raises :class:`StabilityError` that names the measurements that fail."""
    failed = [str(measurement) for measurement in measurements if measurement.verdict == "fail"]
    if failed:
        raise StabilityError(
            f"{len(failed)} rows of the stability sweeps fail: {'; '.join(failed[:20])}",
            remedy="The cases and the origin of their bounds are in docs/stability.md",
        )
