"""The points of the diagrams: a method at a setting, its seconds, and its error."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from lfcore.errors import OpticsError, SceneError
from lfcore.evaluation.true_picture import BELOW_DB, Reference
from lfcore.opencl.device import Device, programs_made
from lfcore.timing import measure_within

COLUMNS = (
    "scene", "panel", "f_number", "method", "setting", "rays_per_pixel", "rays", "seconds",
    "quartile_1_seconds", "quartile_3_seconds", "record_seconds", "bytes", "psnr_true_db",
    "worst_plane_m", "mean_psnr_true_db", "expected_db", "truth_known_db", "note",
)  # fmt: skip
ON_THE_FLY, FROM_FILE, IN_MEMORY = "on the fly", "from a file", "from memory"
"""The panels, by the rays' place when the clock starts."""
NOT_JUDGED = f"not judged: within {BELOW_DB:g} dB of the error of the true picture"
REPEATS = 5
"""The runs of short work."""
BUDGET_SECONDS = 0.3
"""The seconds for all runs of longer work."""


def point(reference: Reference, pictures: np.ndarray, *, rays: int, **context: Any) -> dict:
    """A row with :data:`COLUMNS` of the pictures (P, H, W, 3) of all planes, linear light.

    ``rays`` is their number, ``context`` has the other columns.
    """
    psnr_db = reference.psnr(pictures)
    worst = int(np.argmin(psnr_db))
    known_db = float(reference.known_db[worst])
    return dict.fromkeys(COLUMNS) | {
        "f_number": reference.planes[0].f_number,
        "rays": rays,
        "rays_per_pixel": rays / math.prod(reference.size),
        "psnr_true_db": psnr_db[worst],
        "worst_plane_m": reference.planes[worst].focus_m,
        "mean_psnr_true_db": float(np.mean(psnr_db)),
        "truth_known_db": known_db,
        "note": NOT_JUDGED if psnr_db[worst] > known_db - BELOW_DB else None,
        **context,
    }


def timed_point(
    reference: Reference,
    work: Callable[[], np.ndarray],
    device: Device,
    *,
    rays: int,
    **context: Any,
) -> dict:
    """A row as :func:`point` makes it, with the seconds of ``work``, which makes the pictures.

    A method that refuses the lens or the scene is a :func:`refused_point`.  Any other error passes
    through.
    """
    try:
        pictures, timing = measure_within(
            work, BUDGET_SECONDS, programs_made, repeats=REPEATS, clock=device.clock
        )
    except (OpticsError, SceneError) as error:
        return refused_point(reference, error, rays=rays, **context)
    low, high = timing.quartiles
    seconds = {"seconds": timing.median, "quartile_1_seconds": low, "quartile_3_seconds": high}
    return point(reference, pictures, rays=rays, **seconds, **context)


def refused_point(reference: Reference, error: OpticsError | SceneError, **context: Any) -> dict:
    """The row of a method that refuses the lens, the scene or a quality: ``note`` says why."""
    note = {"f_number": reference.planes[0].f_number, "note": f"refused: {error.problem}"}
    return dict.fromkeys(COLUMNS) | context | note


def table(rows: pd.DataFrame) -> pd.DataFrame:
    """``rows`` with the digits that are published."""
    rows = rows[list(COLUMNS)].astype({"rays": "Int64", "bytes": "Int64"})
    decibels = [name for name in COLUMNS if name.endswith("_db")]
    rows = rows.round(dict.fromkeys(decibels, 1) | {"rays_per_pixel": 1, "f_number": 2})
    for name in COLUMNS:
        if name.endswith("seconds"):
            rows[name] = [float(f"{value:.3g}") for value in rows[name].astype(float)]
    return rows.round({"worst_plane_m": 3})
