"""How far found hits are from the oracle's."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator

import numpy as np

from lfcore.evaluation.stability import naive
from lfcore.evaluation.stability.measurement import (
    DEPTH,
    NO_ANSWER,
    RIGHT,
    Bound,
    Measurement,
    measured,
)
from lfcore.evaluation.stability.shapes import Rays, single
from lfcore.evaluation.stability.tested_tracer import ClosestHit, Found
from lfcore.oracle.crossings import ULP
from lfcore.oracle.intersect import Hits, closest_hits


def oracle_hits(triangles: np.ndarray, rays: Rays) -> Hits:
    """The oracle's hits of the same float32 numbers."""
    return closest_hits(single(triangles), *rays)


def leaks(found: Found, hits: Hits) -> float:
    """Share of the rays that miss although the oracle hits."""
    ids = np.asarray(found[0]).ravel()
    return float(((ids < 0) & (hits.triangle >= 0)).mean())


def mismatches(found: Found, hits: Hits, ulp: float = 16.0) -> float:
    """Share of the rays that name another triangle, of those ``ulp`` from any edge or tie."""
    ids = np.asarray(found[0]).ravel()
    clear = hits.clear(ulp)
    return float((ids != hits.triangle)[clear].mean()) if clear.any() else 0.0


def depth_error(found: Found, hits: Hits) -> float:
    """Largest error of t where the triangle is right: units of 2^-24 t, over the condition
    number 1 / sin of the incidence.  Infinite if any such t is not finite."""
    ids, t = (np.asarray(part).ravel() for part in found)
    same = (ids == hits.triangle) & (ids >= 0)
    if not same.any():
        return 0.0
    with np.errstate(all="ignore"):
        error = np.abs(t[same] - hits.t[same]) / (hits.t * hits.grazing)[same] / ULP
    return float(np.where(np.isfinite(error), error, NO_ANSWER).max())


def condition_of_depth(hits: Hits) -> float:
    """The largest condition number of a depth: 1 / sin of the incidence; 1 without hits."""
    return float(hits.grazing[hits.triangle >= 0].max(initial=1.0))


def compared(
    case: str,
    bound: Bound,
    closest: ClosestHit,
    mesh: np.ndarray,
    rays: Rays,
    error: Callable[[Found], float],
    *,
    condition: float = math.nan,
) -> Measurement:
    """``error`` of what Moeller and Trumbore's method finds and of what ``closest`` finds."""
    return measured(
        case,
        bound,
        lambda: error(naive.moeller_trumbore(mesh, *rays)),
        lambda: error(closest(mesh, *rays)),
        condition=condition,
    )


def choice_and_depth(
    case: str, hits: Hits, naive_found: Found, find: Callable[[], Found], *, limit: str = ""
) -> Iterator[Measurement]:
    """Two measurements of one set of hits: the share of wrong triangles, none admitted, and the
    depth.  ``find()`` gives lfcore's hits, once for both."""
    once = functools.cache(find)

    def of(what: str, bound: Bound, error: Callable[[Found, Hits], float]) -> Measurement:
        return measured(
            f"{case} ({what})",
            bound,
            lambda: error(naive_found, hits),
            lambda: error(once(), hits),
            limit=limit,
            condition=condition_of_depth(hits),
        )

    yield of("triangle", RIGHT, mismatches)
    yield of("depth", DEPTH, depth_error)
