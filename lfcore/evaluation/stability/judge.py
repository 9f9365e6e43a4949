"""How far found hits are from the oracle's."""

from __future__ import annotations

import functools
from collections.abc import Iterator

import numpy as np

from lfcore.errors import OpticsError, SceneError
from lfcore.evaluation.stability.rows import NO_ANSWER, Row
from lfcore.oracle.crossings import ULP
from lfcore.oracle.intersect import Hits, closest_hits


def truth(triangles, origins, directions) -> Hits:
    """The oracle's hits of the same float32 numbers."""
    return closest_hits(np.float32(triangles), origins, directions)


def leaks(found, hits: Hits) -> float:
    """Share of the rays that miss although the oracle hits."""
    ids = np.asarray(found[0]).ravel()
    return float(((ids < 0) & (hits.triangle >= 0)).mean())


def mismatches(found, hits: Hits, ulp: float = 16.0) -> float:
    """Share of the rays that name another triangle, of those ``ulp`` from any edge or tie."""
    ids = np.asarray(found[0]).ravel()
    clear = hits.clear(ulp)
    return float((ids != hits.triangle)[clear].mean()) if clear.any() else 0.0


def depth_error(found, hits: Hits) -> float:
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


def row(case, parameter, value, bound, naive, ours, *, limit="", condition=float("nan")) -> Row:
    """A row of two callables that give an error each; ``ours`` may refuse a scene or a lens.

    Any other error, such as a device's or a file's, is no refusal and passes through.
    """
    known = {"case": case, "parameter": parameter, "value": float(value), "bound": float(bound)}
    known |= {"limit": limit, "condition": float(condition)}
    with np.errstate(all="ignore"):
        known["naive_error"] = float(naive())
        try:
            return Row(error=float(ours()), **known)
        except (SceneError, OpticsError) as error:
            return Row(error=float("nan"), said=str(error), **known)


def choice_and_depth(case, parameter, value, hits, plain, found, *, limit="") -> Iterator[Row]:
    """Two rows of one set of hits: the share of wrong triangles, none admitted, and the depth.

    ``plain`` is what the naive method found, and ``found()`` what lfcore does, once for both.
    """
    once = functools.cache(found)
    for suffix, measure, bound in ((" (triangle)", mismatches, 0.0), (" (depth)", depth_error, 16)):
        yield row(
            case + suffix,
            parameter,
            value,
            bound,
            lambda measure=measure: measure(plain, hits),
            lambda measure=measure: measure(once(), hits),
            limit=limit,
            condition=condition_of_depth(hits),
        )
