"""One point of a work-precision diagram: a method at a setting, its error and its seconds."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from lfcore.colour import display_values
from lfcore.errors import OpticsError, SceneError
from lfcore.evaluation.metrics import psnr
from lfcore.evaluation.tables import TableError
from lfcore.evaluation.timing import measure_within

COLUMNS = (
    "scene", "panel", "f_number", "method", "knob", "rays_per_pixel", "rmse", "order", "psnr_db",
    "seconds", "quartile_1_seconds", "quartile_3_seconds", "repeats", "bits_per_ray",
    "reference_rmse",
)  # fmt: skip
REPEATS = 20
BUDGET_SECONDS = 0.5
MORE_ACCURATE = 10
"""How many times more accurate than a point its reference must be for the point to be shown."""


def rmse(pictures: Iterable[np.ndarray], reference: np.ndarray) -> float:
    """Root mean square error in linear light, pooled over pictures, pixels and channels."""
    return math.sqrt(np.mean([np.square(one - reference).mean() for one in pictures]))


def point(
    work: Callable[[int], np.ndarray],
    reference: np.ndarray,
    reference_rmse: float | None,
    *,
    seeds: int = 1,
    inside: np.ndarray | None = None,
    parts: Mapping[str, np.ndarray] | None = None,
    pictures: int = 1,
    warm: bool = False,
    picture_of: Callable[[object], np.ndarray] = lambda result: result,
    **context,
) -> dict:
    """A row with :data:`COLUMNS` of ``work(seed)``, which makes the picture of ``reference``.

    Parameters
    ----------
    inside : (M, M) bool: pixels that count; default all.
    parts : masks of pixels whose errors stand by themselves, in columns ``rmse_<name>``.
    warm : the program was built by an earlier point.
    pictures : how many a run of ``work`` makes; seconds are of one.
    picture_of : makes the picture of what ``work`` returns, unseen by the clock.
    context : the other columns.

    A method that refuses the lens or scene is a row without error, shown as failed; what a device
    or a file has to say passes through.
    """
    row = dict.fromkeys(COLUMNS) | {"reference_rmse": reference_rmse} | context
    try:
        results, timing = measure_within(
            work, BUDGET_SECONDS, repeats=REPEATS, seeds=seeds, warm=warm
        )
        made = [picture_of(result) for result in results]
    except (OpticsError, SceneError):
        return row
    where = np.ones(reference.shape[:2], bool) if inside is None else inside
    error = rmse([one[where] for one in made], reference[where])
    if not math.isfinite(error):
        return row
    low, middle, high = (
        t / pictures for t in (timing.quartiles[0], timing.median, timing.quartiles[1])
    )
    truth = display_values(reference[where])
    quality = [psnr(display_values(one[where]), truth, peak=255) for one in made]
    return row | {
        "rmse": error,
        "psnr_db": float(np.mean(quality)) if error else None,
        "seconds": middle,
        "quartile_1_seconds": low,
        "quartile_3_seconds": high,
        "repeats": len(timing.seconds),
        **{
            f"rmse_{name}": rmse([one[mask] for one in made], reference[mask])
            for name, mask in (parts or {}).items()
            if mask.any()
        },
    }


def trusted(rows: Iterable[dict]) -> list[dict]:
    """Rows whose reference is :data:`MORE_ACCURATE` times more accurate, and failures.

    The others say as much of the reference as of the method, and are not shown.
    """
    return [row for row in rows if not too_good(row)]


def too_good(row: Mapping) -> bool:
    """Whether a row's error is too near to its reference's own to be told from it."""
    error, doubt = row["rmse"], row["reference_rmse"]
    return bool(error) and doubt is not None and error < MORE_ACCURATE * doubt


def check_trusted(rows: Iterable[Mapping]) -> None:
    """Raises :class:`TableError` unless every shown point's reference is accurate enough."""
    bad = [row for row in rows if too_good(row)]
    if bad:
        first = bad[0]
        raise TableError(
            f"{len(bad)} points are within {MORE_ACCURATE} times of the error of their "
            f"reference, the first is {first['method']}, {first['knob']}",
            remedy="Raise analysis.work_precision.reference_views",
        )


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
