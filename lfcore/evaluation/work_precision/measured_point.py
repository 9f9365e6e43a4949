"""One point of a diagram: a method at a setting, its error against the true picture, its seconds.

What comes nearer to a reference than the reference is known to cannot be judged by it.  Such a
point keeps its seconds, and a note says why it has no error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import TypeVar

import numpy as np
import pandas as pd

from lfcore.colour import display_values
from lfcore.errors import OpticsError, SceneError
from lfcore.evaluation.metrics import psnr
from lfcore.evaluation.true_picture.reference import BELOW_DB
from lfcore.opencl.device import programs_made
from lfcore.timing import measure_within

Result = TypeVar("Result")
COLUMNS = (
    "scene", "panel", "f_number", "method", "knob", "rays_per_pixel", "rmse", "order", "psnr_db",
    "psnr_codec_db", "seconds", "quartile_1_seconds", "quartile_3_seconds", "repeats",
    "read_seconds", "bytes", "reference_rmse", "note",
)  # fmt: skip
REPEATS = 9
"""Of short work: quartiles are the third run and the seventh, so that one outlier moves neither."""
BUDGET_SECONDS = 0.5
TIMES_BELOW = 10 ** (BELOW_DB / 20)
"""How many times smaller than an error that it judges a reference's own must be."""
NOT_JUDGED = "not judged"


def rmse(pictures: Iterable[np.ndarray], reference: np.ndarray) -> float:
    """Root mean square error in linear light, pooled over pictures, pixels and channels."""
    return math.sqrt(np.mean([np.square(one - reference).mean() for one in pictures]))


def measured_point(
    work: Callable[[int], Result],
    reference: np.ndarray,
    reference_rmse: float | None,
    *,
    seeds: int = 1,
    inside: np.ndarray | None = None,
    masks: Mapping[str, np.ndarray] | None = None,
    pictures: int = 1,
    picture_of: Callable[[Result], np.ndarray] = np.asarray,
    **context: object,
) -> dict:
    """A row with :data:`COLUMNS` of ``work(seed)``, which makes the picture of ``reference``.

    Parameters
    ----------
    reference_rmse : its own error, of the pixels that count.
    inside : (M, M) bool: pixels that count; default all.
    masks : of pixels whose errors stand by themselves, in columns ``rmse_<name>``.
    pictures : how many a run of ``work`` makes; seconds are of one.
    picture_of : makes the picture of what ``work`` returns, unseen by the clock.
    context : the other columns.

    A method that refuses the lens or scene is a row without error whose ``note`` says why; what a
    device or a file has to say passes through.
    """
    row = dict.fromkeys(COLUMNS) | {"reference_rmse": reference_rmse} | context
    try:
        results, timing = measure_within(
            work, BUDGET_SECONDS, programs_made, repeats=REPEATS, seeds=seeds
        )
        made = [picture_of(result) for result in results]
    except (OpticsError, SceneError) as error:
        return row | {"note": f"refused: {error.problem}"}
    where = np.ones(reference.shape[:2], bool) if inside is None else inside
    found = rmse([one[where] for one in made], reference[where])
    if not math.isfinite(found):
        return row | {"note": "refused: the picture has no finite colours"}
    low, middle, high = (
        t / pictures for t in (timing.quartiles[0], timing.median, timing.quartiles[1])
    )
    truth = display_values(reference[where])
    quality = [psnr(display_values(one[where]), truth, peak=255) for one in made]
    return judged(
        row
        | {
            "rmse": found,
            "psnr_db": float(np.mean(quality)) if found else None,
            "seconds": middle,
            "quartile_1_seconds": low,
            "quartile_3_seconds": high,
            "repeats": len(timing.seconds),
            **{
                f"rmse_{name}": rmse([one[mask] for one in made], reference[mask])
                for name, mask in (masks or {}).items()
                if mask.any()
            },
        }
    )


def judged(row: Mapping) -> dict:
    """``row``, without an error and with a note where its reference is not known well enough."""
    row = dict(row)
    for name in [name for name in row if name.startswith("rmse_")]:  # of a kind of pixels
        if not _can_judge(row.get(name.replace("rmse", "reference", 1)), row[name]):
            row[name] = None
    error, doubt = row["rmse"], row["reference_rmse"]
    if _can_judge(doubt, error):
        return row
    note = f"{NOT_JUDGED}: error {error:.2g}, and the reference is known to {doubt:.2g}"
    return row | {"rmse": None, "psnr_db": None, "note": note}


def _can_judge(doubt: float | None, error: float | None) -> bool:
    return not error or doubt is None or error >= TIMES_BELOW * doubt


def rounded(points: pd.DataFrame) -> pd.DataFrame:
    """Points as a table to publish: no more digits than were measured."""
    table = points.copy()
    for column in table.select_dtypes("float").columns:
        table[column] = [float(f"{value:.4g}") for value in table[column]]
    return table
