"""The cheapest setting that reaches a quality, per scene, from measured work-precision points."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

TASKS = {
    "quadrature": ("trace one picture", "seconds"),
    "methods": ("refocus a light field", "seconds"),
    "storage": ("store a light field", "bits_per_ray"),
}
"""What each panel is for, and the cost that counts."""
DEFAULT_TASK = "store with the default encoder"
"""As storing, by the curve of the storage panel that is called ``default``: the default CRF is the
one that is recommended here for 45 dB in the most demanding scene."""
COLUMNS = (
    "scene", "task", "f_number", "target_db", "method", "setting", "psnr_db", "seconds",
    "bits_per_ray",
)  # fmt: skip


def recommendation(points: pd.DataFrame, targets_db: Sequence[float]) -> pd.DataFrame:
    """Columns :data:`COLUMNS`, one row a scene, task, aperture and target.

    Parameters
    ----------
    points : columns of :mod:`lfcore.evaluation.work_precision.point`.
    targets_db : PSNR to reach.

    Where no point reaches a target, method and cost are unknown, ``setting`` says so and
    ``psnr_db`` is the best that was reached.
    """
    rows = []
    for (scene, panel, f_number), group in points.groupby(
        ["scene", "panel", "f_number"], sort=False
    ):
        measured = group[group.psnr_db.notna()]
        if panel not in TASKS or measured.empty:
            continue
        task, cost = TASKS[panel]
        tasks = {task: measured}
        if panel == "storage":
            tasks[DEFAULT_TASK] = measured[measured.method == "default"]
        for task, some in tasks.items():
            context = {"scene": scene, "task": task, "f_number": f_number}
            for target in targets_db:
                rows.append({**context, "target_db": target, **_cheapest(some, target, cost)})
    return pd.DataFrame(rows, columns=list(COLUMNS))


def _cheapest(points: pd.DataFrame, target: float, cost: str) -> dict:
    enough = points[points.psnr_db >= target]
    if enough.empty:
        return {"setting": "none measured reaches it", "psnr_db": points.psnr_db.max()}
    best = enough.loc[enough[cost].idxmin()]
    kept = {key: best[key] for key in ("method", "psnr_db", "seconds", "bits_per_ray")}
    return {**kept, "setting": best["knob"]}
