"""One point of a work-precision diagram: a method at a setting, its error and its seconds."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
import pandas as pd

from lfcore.errors import LfcoreError
from lfcore.evaluation.metrics import psnr
from lfcore.evaluation.timing import Timing
from lfcore.scene.colour import linear_to_srgb

COLUMNS = (
    "scene", "panel", "f_number", "method", "knob", "rays_per_pixel", "rmse", "order", "psnr_db",
    "edge_share", "seconds", "quartile_1_seconds", "quartile_3_seconds", "repeats",
    "bits_per_ray", "reference_rmse", "resolved",
)  # fmt: skip
REPEATS = 20
BUDGET_SECONDS = 0.5
EDGES = 0.1
RESOLVED = 10
"""How many times more accurate than a point its reference must be for the point to be trusted."""


def timed(work: Callable[[int], np.ndarray], *, seeds: int = 1) -> tuple[list[np.ndarray], Timing]:
    """Results of ``work(seed)`` for the first ``seeds`` seeds, and seconds of its repeats.

    The first run is not timed.  Runs of up to a twentieth of :data:`BUDGET_SECONDS` repeat
    :data:`REPEATS` times; longer ones as often as the budget allows, but once a seed.
    """
    begun = time.perf_counter()
    work(0)
    first = time.perf_counter() - begun
    least, results, seconds = max(1, seeds), [], []
    for repeat in range(REPEATS):
        spent = sum(seconds)
        typical = min(seconds, default=first)
        if repeat >= least and spent + typical > BUDGET_SECONDS:
            break
        begun = time.perf_counter()
        result = work(repeat % least)
        seconds.append(time.perf_counter() - begun)
        if repeat < least:
            results.append(result)
    return results, Timing(tuple(seconds))


def rmse(pictures: Iterable[np.ndarray], reference: np.ndarray) -> float:
    """Root mean square error in linear light, pooled over pictures, pixels and channels."""
    return math.sqrt(np.mean([np.square(one - reference).mean() for one in pictures]))


def edge_share(pictures: Sequence[np.ndarray], reference: np.ndarray) -> float | None:
    """Share of the squared error in the tenth of the pixels where the reference is steepest.

    A tenth, were errors everywhere alike; None without error.
    """
    error = np.sum([np.square(one - reference).sum(-1) for one in pictures], axis=0).ravel()
    steep = np.hypot(*np.gradient(reference.mean(-1))).ravel()
    worst = np.argsort(steep)[-max(1, round(EDGES * steep.size)) :]
    return float(error[worst].sum() / error.sum()) if error.any() else None


def codes(picture: np.ndarray) -> np.ndarray:
    """sRGB on the scale of 8-bit codes, not rounded: what published PSNR is of."""
    return 255.0 * linear_to_srgb(np.clip(picture, 0, 1))


def point(
    work: Callable[[int], np.ndarray],
    reference: np.ndarray,
    reference_rmse: float | None,
    *,
    seeds: int = 1,
    inside: np.ndarray | None = None,
    seconds_of: Callable[[], float] | None = None,
    **context,
) -> dict:
    """A row with :data:`COLUMNS` of ``work(seed)``, which makes the picture of ``reference``.

    Parameters
    ----------
    inside : (M, M) bool: pixels that count; default all.
    seconds_of : what to add to the seconds of every run (work done once for many pictures).
    context : the other columns.

    A method that refuses is a row without error: it failed, and is shown as failed.
    """
    row = dict.fromkeys(COLUMNS) | {"reference_rmse": reference_rmse} | context
    try:
        pictures, timing = timed(work, seeds=seeds)
    except LfcoreError:
        return row
    where = np.ones(reference.shape[:2], bool) if inside is None else inside
    error = rmse([one[where] for one in pictures], reference[where])
    added = seconds_of() if seconds_of else 0.0
    low, high = timing.quartiles
    quality = [psnr(codes(one[where]), codes(reference[where]), peak=255) for one in pictures]
    if not math.isfinite(error):
        return row
    return row | {
        "rmse": error,
        "psnr_db": float(np.mean(quality)) if error else None,
        "edge_share": edge_share(pictures, reference) if inside is None else None,
        "seconds": timing.median + added,
        "quartile_1_seconds": low + added,
        "quartile_3_seconds": high + added,
        "repeats": len(timing.seconds),
        "resolved": reference_rmse is None or error >= RESOLVED * reference_rmse,
    }


def with_orders(rows: Iterable[dict]) -> Iterator[dict]:
    """Rows of one curve, in order of N, with the order of convergence observed between them.

    ``error ~ N^-order``, N the square root of the rays a pixel: 1 for independent samples, since
    their error falls with the square root of their number.
    """
    before = None
    for row in rows:
        if before and row["rmse"] and before["rmse"]:
            rays = math.sqrt(row["rays_per_pixel"] / before["rays_per_pixel"])
            row = row | {"order": math.log(before["rmse"] / row["rmse"]) / math.log(rays)}
        yield row
        before = row


def fitted_order(side: Sequence[float], error: Sequence[float]) -> float:
    """Least-squares order of ``error ~ side^-order``; NaN for fewer than two points."""
    if len(side) < 2:
        return math.nan
    return float(-np.polyfit(np.log(side), np.log(error), 1)[0])


def rounded(points: pd.DataFrame) -> pd.DataFrame:
    """Points as a table to publish: no more digits than were measured."""
    table = points.copy()
    for column in table.select_dtypes("float").columns:
        table[column] = [float(f"{value:.4g}") for value in table[column]]
    return table
