"""Case 14: NaN, infinities and random bits, in rays and in triangles.

Error: share of the valid rays whose answer changes, counting a crash or NaN as all; bound 0.  And
the CPU time that invalid rays take, over that of valid ones.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from lfcore.evaluation.stability import naive
from lfcore.evaluation.stability.judge import mismatches, row, truth
from lfcore.evaluation.stability.rows import Row
from lfcore.evaluation.stability.shapes import random_rays, soup
from lfcore.evaluation.stability.subject import Subject, kept
from lfcore.evaluation.timing import measure

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
    """CPU seconds of spoilt rays over those of sound ones; bound 2.5, as in Embree's tests.

    Seconds of the processor, and the least of several: other processes take none of these.
    """
    mesh = np.float32(soup(500, 0.1))
    rays = random_rays(4000, 0.4)
    for number, pattern in enumerate(PATTERNS[:4]):
        spoilt = rays[0].copy(), rays[1].copy()
        spoilt[1][:, 0] = pattern

        def ratio(closest, spoilt=spoilt):
            sound, bad = (
                measure(lambda some=some: closest(mesh, *some), clock=time.process_time)
                for some in (rays, spoilt)
            )
            return min(bad.seconds) / min(sound.seconds)

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
    """As many spoilt triangles as sound ones, or random bits, of which what is sound is left out.

    Error: share of the rays that name another triangle than the oracle does among those that a
    scene's loader keeps; a denormal coordinate makes a sound triangle.
    """
    mesh = np.float32(soup(300, 0.1))
    rays = random_rays(1000, 0.4)
    rng = np.random.default_rng(14)
    for number in range(len(PATTERNS) + 1):
        bad = mesh.copy()
        if number < len(PATTERNS):
            bad[np.arange(300), rng.integers(0, 3, 300), rng.integers(0, 3, 300)] = PATTERNS[number]
        else:
            bad = rng.integers(0, 2**32, (300, 3, 3), np.uint32).view(np.float32)
            bad = bad[~kept(bad)]
        both = np.concatenate([mesh, bad])
        keep = np.append(np.flatnonzero(kept(both)), -1)
        hits = truth(both[keep[:-1]], *rays)
        hits = replace(hits, triangle=keep[hits.triangle])
        yield row(
            "invalid triangles",
            "pattern",
            number,
            0.0,
            lambda both=both, hits=hits: mismatches(naive.moeller_trumbore(both, *rays), hits),
            lambda both=both, hits=hits: mismatches(subject.closest(both, *rays), hits),
        )


CASES = (invalid_rays, invalid_rays_time, invalid_triangles)
