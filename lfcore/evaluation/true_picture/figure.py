"""True error against run time: a column a scene, a row an aperture."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lfcore.evaluation.diagrams import FRONT, PointLabel, pareto, save_diagrams
from lfcore.evaluation.figures import log_ticks
from lfcore.evaluation.true_picture.points import BY_DEPTH, NEAREST, TO_QUALITY, worst_planes
from lfcore.evaluation.true_picture.reference import BELOW_DB

STYLES = {
    BY_DEPTH: ("C0", "o", "by depth (lens samples x rays of a pixel, a side)"),
    TO_QUALITY: ("C2", "^", "by depth, as many rays as a quality takes"),
    NEAREST: ("C1", "s", "nearest pixel (lens samples x rays of a pixel, a side)"),
    "Mitsuba 3": ("C3", "D", "Mitsuba 3, expected for all planes, against its own truth"),
    "POV-Ray": ("C4", "v", "POV-Ray, expected for all planes, against its own truth"),
}
GOALS_DB = (40, 45, 50)
THESIS_LATTICE = "512 x 1"


def true_errors(path: str | Path, rows: pd.DataFrame, *, machine: str) -> None:
    """Draw ``rows`` with the columns of :mod:`~lfcore.evaluation.true_picture.points`.

    Parameters
    ----------
    machine : what the seconds were measured on.
    """
    worst = worst_planes(rows)
    scenes, stops = worst.scene.unique(), sorted(worst.f_number.unique())
    figure = Figure(figsize=(4.6 * len(scenes), 3.8 * len(stops) + 0.5))
    axes = figure.subplots(len(stops), len(scenes), squeeze=False)
    labels: list[PointLabel] = []
    legend: dict[str, Artist] = {}
    for axis, (stop, scene) in zip(axes.flat, product(stops, scenes), strict=True):
        panel = worst[(worst.scene == scene) & np.isclose(worst.f_number, stop)]
        labels += _panel(axis, panel)
        axis.set_title(f"{scene}, f/{stop:g}", fontsize=10)
        handles, names = axis.get_legend_handles_labels()
        legend.update(zip(names, handles, strict=True))
    columns = min(2, len(scenes))
    figure.legend(legend.values(), legend, loc="outside upper center", ncols=columns, fontsize=8)
    caption = (
        f"seconds of one core for all planes ({machine})\n"
        "Upper left is better. Grey: the Pareto front. Ring: N = 512, the thesis's recipe.\n"
        "Dotted: what the truth can judge; hollow points are beyond."
    )
    save_diagrams(path, figure, labels, caption)


def _panel(axis: Axes, rows: pd.DataFrame) -> list[PointLabel]:
    """Draw one diagram; returns the labels that its points are to have."""
    log_ticks(axis.xaxis)
    axis.set_ylabel("PSNR of the worst plane, dB", fontsize=9)
    for goal in GOALS_DB:
        axis.axhline(goal, color="0.85", linewidth=1, zorder=0)
    front = rows[pareto(-rows.psnr_true_db, rows.seconds)].sort_values("seconds")
    axis.plot(front.seconds, front.psnr_true_db, **FRONT)
    labels = []
    for method, (colour, marker, label) in STYLES.items():
        curve = rows[rows.method == method].sort_values("rays")
        if curve.empty:
            continue
        style: dict[str, Any] = {"color": colour, "marker": marker, "markersize": 4}
        judged = curve.note.isna()
        axis.plot(curve.seconds, curve.psnr_true_db, color=colour)
        axis.plot([], [], label=label, **style)
        for some, face in ((curve[judged], colour), (curve[~judged], "white")):
            axis.plot(some.seconds, some.psnr_true_db, linestyle="", markerfacecolor=face, **style)
        points = zip(curve.seconds, curve.psnr_true_db, curve.lattice, strict=True)
        labels += [PointLabel(axis, *point, colour) for point in points]
    thesis = rows[(rows.method == NEAREST) & (rows.lattice == THESIS_LATTICE)]
    axis.plot(
        thesis.seconds, thesis.psnr_true_db, "o", color="0.2", markersize=11, fillstyle="none"
    )
    axis.axhline(rows.truth_known_db.min() - BELOW_DB, color="0.4", linestyle=":", linewidth=1)
    axis.margins(x=0.12, y=0.15)
    return labels
