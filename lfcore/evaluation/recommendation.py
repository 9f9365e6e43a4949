"""The cheapest setting that reaches a quality, per scene, from measured work-precision points."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

TASKS = {
    "quadrature": ("trace a picture in focus", "seconds"),
    "tracing": ("trace a refocused picture", "seconds"),
    "recorded": ("refocus a light field in memory", "seconds"),
    "storage": ("store a light field", "bytes"),
}
"""What each panel is for, and the cost that counts."""
DEFAULT_TASK = "store with the default encoder"
"""What the default encoder loses of a grid of views: the default CRF is the one that is recommended
here for 45 dB in the most demanding scene."""
OF_GRID = "default, N = "
"""How that curve of the storage panel begins; the encoder's loss is told apart from what the grid
itself is wrong by, which no CRF changes."""
COLUMNS = (
    "scene", "task", "f_number", "target_db", "method", "setting", "psnr_db", "seconds", "bytes",
)  # fmt: skip


def recommendation(points: pd.DataFrame, targets_db: Sequence[float]) -> pd.DataFrame:
    """Columns :data:`COLUMNS`, one row a scene, task, aperture and target.

    Parameters
    ----------
    points : columns of :mod:`lfcore.evaluation.work_precision.measured_point`.
    targets_db : PSNR to reach.

    Where no point reaches a target, method and cost are unknown, ``setting`` says so and
    ``psnr_db`` is the best that was reached.  Points that cannot be judged reach nothing.
    """
    rows = []
    for (scene, panel, f_number), group in points.groupby(
        ["scene", "panel", "f_number"], sort=False
    ):
        if panel not in TASKS or group.psnr_db.isna().all():
            continue
        task, cost = TASKS[panel]
        tasks = {task: group}
        if panel == "storage":
            grid = group[group.method.str.startswith(OF_GRID)]
            tasks[DEFAULT_TASK] = grid.assign(psnr_db=grid.psnr_codec_db)
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
    kept = {key: best[key] for key in ("method", "psnr_db", "seconds", "bytes")}
    return {**kept, "setting": best["knob"]}
