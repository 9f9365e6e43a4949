"""Curves through keys over time, as animations have them.

Source: Khronos, "glTF 2.0 Specification", appendix C.
"""

import math
from dataclasses import dataclass

import numpy as np

STEP, LINEAR, CUBIC = "STEP", "LINEAR", "CUBICSPLINE"
"""The kinds of curves, by glTF's names."""


@dataclass(frozen=True, eq=False)
class Curve:
    """A quantity over time, through keys; it rests before the first and after the last.

    Attributes
    ----------
    times : (K,) float64, seconds, ascending; K >= 1.
    values : (K, ...) float64, at the keys; of a cubic spline (K, 3, ...): the tangent before each
        key, per second, the value, and the tangent after it.
    kind : :data:`STEP`, :data:`LINEAR` or :data:`CUBIC`.
    turns : whether values are quaternions, w last, which move on the shortest arc.
    """

    times: np.ndarray
    values: np.ndarray
    kind: str = LINEAR
    turns: bool = False

    def at(self, time_s: float) -> np.ndarray:
        """The value at an instant; quaternions have the length 1."""
        values = self.values[:, 1] if self.kind == CUBIC else self.values
        key = int(np.searchsorted(self.times, time_s, side="right")) - 1
        if key < 0 or key == len(self.times) - 1 or self.kind == STEP:
            return self._unit(values[max(key, 0)])
        span = self.times[key + 1] - self.times[key]
        share = (time_s - self.times[key]) / span
        before, after = values[key], values[key + 1]
        if self.kind == CUBIC:
            leaving, arriving = self.values[key, 2] * span, self.values[key + 1, 0] * span
            return self._unit(_hermite(share, before, leaving, after, arriving))
        if self.turns:
            return _on_arc(share, self._unit(before), self._unit(after))
        return before + share * (after - before)

    def _unit(self, value: np.ndarray) -> np.ndarray:
        return value / (np.linalg.norm(value) or 1.0) if self.turns else value


def _hermite(
    t: float, before: np.ndarray, leaving: np.ndarray, after: np.ndarray, arriving: np.ndarray
) -> np.ndarray:
    """The cubic through two values with tangents, at ``t`` from 0 to 1."""
    square, cube = t * t, t * t * t
    return (
        (2 * cube - 3 * square + 1) * before + (cube - 2 * square + t) * leaving
        + (3 * square - 2 * cube) * after + (cube - square) * arriving
    )  # fmt: skip


def _on_arc(share: float, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """The quaternion between two unit ones, on the shorter arc."""
    if before @ after < 0:
        after = -after
    # From the chord: the cosine of a small angle has lost it.
    angle = 2 * math.atan2(np.linalg.norm(after - before), np.linalg.norm(after + before))
    if angle == 0:
        return before
    parts = math.sin((1 - share) * angle) * before + math.sin(share * angle) * after
    return parts / math.sin(angle)
