"""Case 14: NaN, infinities and random bits, in rays and in triangles.

Error: share of the valid rays whose answer changes, counting a crash or NaN as all; bound 0.  And
the time that invalid rays take, over that of valid ones.
"""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from lfcore.evaluation.stability import naive
from lfcore.evaluation.stability.judge import row
from lfcore.evaluation.stability.rows import Row
from lfcore.evaluation.stability.shapes import random_rays, soup
from lfcore.evaluation.stability.subject import Subject

PATTERNS = (np.nan, np.inf, -np.inf, 3e38, 1e-45)


def invalid_rays(subject: Subject) -> Iterator[Row]:
    """Every second ray is spoilt in one coordinate; the others must not notice."""
    mesh = np.float32(soup(500, 0.1))
    rays = random_rays(1000, 0.4)
    clean = subject.closest(mesh, *rays)
    plain_clean = naive.moeller_trumbore(mesh, *rays)
    for number, pattern in enumerate(PATTERNS):
        origins, directions = rays[0].copy(), rays[1].copy()
        origins[0::4, number % 2] = pattern
        directions[2::4, number % 2] = pattern
        spoilt = origins, directions
        yield row(
            "invalid rays",
            "pattern",
            number,
            0.0,
            lambda spoilt=spoilt: _changed(
                naive.moeller_trumbore(mesh, *spoilt), plain_clean, pattern_bad(spoilt)
            ),
            lambda spoilt=spoilt: _changed(
                subject.closest(mesh, *spoilt), clean, pattern_bad(spoilt)
            ),
        )


def invalid_rays_time(subject: Subject) -> Iterator[Row]:
    """Seconds of spoilt rays over those of sound ones; bound 2.5, as in Embree's tests."""
    mesh = np.float32(soup(500, 0.1))
    rays = random_rays(4000, 0.4)
    for number, pattern in enumerate(PATTERNS[:4]):
        spoilt = rays[0].copy(), rays[1].copy()
        spoilt[1][:, 0] = pattern

        def ratio(closest, spoilt=spoilt):
            seconds = ([], [])
            for repeat in range(6):
                for taken, some in zip(seconds, (rays, spoilt), strict=True):
                    begun = time.perf_counter()
                    closest(mesh, *some)
                    if repeat:
                        taken.append(time.perf_counter() - begun)
            return np.median(seconds[1]) / np.median(seconds[0])

        yield row(
            "invalid rays (time)",
            "pattern",
            number,
            2.5,
            lambda ratio=ratio: ratio(naive.moeller_trumbore),
            lambda ratio=ratio: ratio(subject.closest),
        )


def pattern_bad(rays: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """(R,) bool: rays that are not finite, which must miss."""
    return ~(np.isfinite(rays[0]).all(1) & np.isfinite(rays[1]).all(1))


def _changed(found, clean, must_miss) -> float:
    same = (found[0] == clean[0]) & ((found[1] == clean[1]) | (clean[0] < 0))
    wrong = ~same[1::2].all() + (found[0][must_miss] >= 0).mean() if must_miss.any() else 0.0
    return float(wrong) + float((~same[1::2]).mean())


def invalid_triangles(subject: Subject) -> Iterator[Row]:
    """As many spoilt triangles as sound ones, or meshes of random bits beside them."""
    mesh = np.float32(soup(300, 0.1))
    rays = random_rays(1000, 0.4)
    clean = subject.closest(mesh, *rays)
    rng = np.random.default_rng(14)
    for number in range(len(PATTERNS) + 1):
        bad = mesh.copy()
        if number < len(PATTERNS):
            bad[np.arange(300), rng.integers(0, 3, 300), rng.integers(0, 3, 300)] = PATTERNS[number]
        else:
            bad = rng.integers(0, 2**32, (300, 3, 3), np.uint32).view(np.float32)
        if number == 4:
            continue  # a denormal coordinate is a sound triangle
        both = np.concatenate([mesh, bad])
        yield row(
            "invalid triangles",
            "pattern",
            number,
            0.0,
            lambda both=both: (naive.moeller_trumbore(both, *rays)[0] != clean[0]).mean(),
            lambda both=both: (subject.closest(both, *rays)[0] != clean[0]).mean(),
        )


CASES = (invalid_rays, invalid_rays_time, invalid_triangles)
