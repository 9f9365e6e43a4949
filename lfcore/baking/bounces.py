"""Bounces: light goes from surface to surface until further bounces add little.

A bounce is one step x' = e + R x, where e is the light of emitters and R reflects.  The changes of
successive steps soon form a geometric series, which is summed in advance.

Source: A. C. Aitken, "On Bernoulli's Numerical Solution of Algebraic Equations", 1926.
"""

import numpy as np

from lfcore.baking.surroundings import mean_colour
from lfcore.scene.baked import DARK

MOST_BOUNCES = 64
"""The most bounces; the sum of the series converges long before, unless no light leaves."""
_LARGEST_RATIO = 0.99
"""The largest ratio of the series: beyond it, hardly any light leaves the scene."""
_SMALL = 0.1
"""The change that ends bounces, a share of the required error."""


class Bounces:
    """Irradiance after some bounces, and an estimate of what all further bounces add.

    Parameters
    ----------
    irradiance : (P, 3) before the first bounce.
    judged : (S,) the mask of the first S points by which changes are judged.

    Attributes
    ----------
    irradiance : (P, 3) after the bounces so far.
    limit : (P, 3) after all bounces, as estimated.
    change : the last change of the limit, a share of the light.
    """

    def __init__(self, irradiance: np.ndarray, judged: np.ndarray):
        self.irradiance = self.limit = irradiance
        self.change, self._judged = np.inf, np.flatnonzero(judged)
        self._difference, self._diverges = np.zeros_like(irradiance), False

    def add(self, irradiance: np.ndarray) -> None:
        """Take the irradiance (P, 3) after one more bounce."""
        difference, before = irradiance - self.irradiance, self._difference
        ratio = _total(difference * before) / np.maximum(_total(before**2), 1e-300)
        self._diverges = bool((ratio > _LARGEST_RATIO).any())
        ratio = np.clip(ratio, 0, _LARGEST_RATIO)
        limit = irradiance + (ratio / (1 - ratio)).astype(np.float32) * difference
        self.change = self._share(limit, self.limit)
        self.irradiance, self.limit, self._difference = irradiance, limit, difference

    def is_converged(self, error: float) -> bool:
        """Return whether the limit changes by much less than the required error."""
        return self.change <= _SMALL * error

    def missing_from(self, irradiance: np.ndarray) -> float:
        """Return the light that an irradiance (P, 3) lacks, a share of all; infinite if it grows
        with every bounce."""
        if self._diverges and self._share(self.limit, self.irradiance) > 0:
            return np.inf
        return max(self._share(self.limit, irradiance), min(self.change, 1.0))

    def _share(self, light: np.ndarray, other: np.ndarray) -> float:
        """Return the root mean square difference (P, 3) of judged points, a share of ``light``."""
        level, off = (mean_colour(a[self._judged]) for a in (light, light - other))
        if not len(level):
            return 0.0
        level = np.maximum(level, max(DARK * float(_total(level)) / len(level), 1e-30))
        return float(np.sqrt(_total((off / level) ** 2) / len(level)))


def _total(values: np.ndarray) -> np.ndarray:
    """Return sums over the first axis, added in order: libraries add in other orders on other
    processors."""
    return np.cumsum(values, 0, dtype=np.float64)[-1]
