"""Case 14: NaN, infinities and random bits, in rays and in triangles.

Error: share of the valid rays whose answer changes, counting a crash or NaN as all; bound 0.  And
the CPU time that invalid rays take, over that of valid ones.
"""

from __future__ import annotations

import functools
import time
from dataclasses import replace

import numpy as np

from lfcore.evaluation.stability.measurement import (
    CHOICE,
    Bound,
    Measurement,
    compared,
    mismatches,
    oracle_hits,
    sweep,
)
from lfcore.evaluation.stability.shapes import random_rays, single, soup
from lfcore.evaluation.stability.tested_tracer import ClosestHit, TracerUnderTest, kept
from lfcore.timing import measure_in_turn

PATTERNS = (np.nan, np.inf, -np.inf, 3e38, 1e-45)


@sweep("14", "pattern", range(len(PATTERNS)))
def invalid_rays(tracer: TracerUnderTest, number: int) -> Measurement:
    """Every second ray is spoilt in one coordinate; the others must not notice."""
    mesh = single(soup(500, 0.1))
    rays = random_rays(1000)
    origins, directions = rays[0].copy(), rays[1].copy()
    origins[0::4, number % 2] = PATTERNS[number]
    directions[2::4, number % 2] = PATTERNS[number]
    must_miss = ~(np.isfinite(origins).all(1) & np.isfinite(directions).all(1))

    def changed(closest: ClosestHit) -> float:
        clean, found = closest(mesh, *rays), closest(mesh, origins, directions)
        same = (found[0] == clean[0]) & ((found[1] == clean[1]) | (clean[0] < 0))
        wrong = ~same[1::2].all() + (found[0][must_miss] >= 0).mean() if must_miss.any() else 0.0
        return float(wrong) + float((~same[1::2]).mean())

    bound = Bound(0, CHOICE, "rays do not know of each other")
    return compared("invalid rays", bound, changed, tracer.closest)


@sweep("14", "pattern", range(len(PATTERNS) - 1))
def invalid_rays_time(tracer: TracerUnderTest, number: int) -> Measurement:
    """CPU seconds of spoilt rays over those of sound ones; bound 2.5, as in Embree's tests.

    Seconds of the processor, and the least of several: other processes take none of these.
    """
    mesh = single(soup(500, 0.1))
    rays = random_rays(4000)
    spoilt = rays[0].copy(), rays[1].copy()
    spoilt[1][:, 0] = PATTERNS[number]

    def ratio(closest: ClosestHit) -> float:
        works = [functools.partial(closest, mesh, *some) for some in (rays, spoilt)]
        sound, bad = measure_in_turn(works, repeats=5, clock=time.process_time)
        return min(bad.seconds) / min(sound.seconds)

    bound = Bound(2.5, "seconds over those of sound rays", "Embree's own bound")
    return compared("invalid rays (time)", bound, ratio, tracer.closest)


@sweep("14", "pattern", range(len(PATTERNS) + 1))
def invalid_triangles(tracer: TracerUnderTest, number: int) -> Measurement:
    """As many spoilt triangles as sound ones, or random bits, of which what is sound is left out.

    Error: share of the rays that name another triangle than the oracle does among those that a
    scene's loader keeps; a denormal coordinate makes a sound triangle.
    """
    mesh = single(soup(300, 0.1))
    rays = random_rays(1000)
    rng = np.random.default_rng((14, number))
    if number < len(PATTERNS):
        bad = mesh.copy()
        bad[np.arange(300), rng.integers(0, 3, 300), rng.integers(0, 3, 300)] = PATTERNS[number]
    else:
        bad = rng.integers(0, 2**32, (300, 3, 3), np.uint32).view(np.float32)
        bad = bad[~kept(bad)]
    both = np.concatenate([mesh, bad])
    keep = np.append(np.flatnonzero(kept(both)), -1)
    hits = oracle_hits(both[keep[:-1]], rays)
    hits = replace(hits, triangle=keep[hits.triangle])

    def wrong(closest: ClosestHit) -> float:
        return mismatches(closest(both, *rays), hits)

    bound = Bound(0, CHOICE, "what is not finite is never met")
    return compared("invalid triangles", bound, wrong, tracer.closest)
