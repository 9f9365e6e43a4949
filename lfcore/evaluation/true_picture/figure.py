"""True error against run time: a column a scene, a row an aperture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lfcore.evaluation.figures import log_ticks, save_figure
from lfcore.evaluation.point_labels import PointLabel, label_points
from lfcore.evaluation.true_picture.points import BY_DEPTH, NEAREST, TO_QUALITY, worst_planes
from lfcore.evaluation.true_picture.reference import BELOW_DB
from lfcore.evaluation.work_precision.figure import pareto

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
    scenes, stops = list(dict.fromkeys(worst.scene)), sorted(worst.f_number.unique())
    figure = Figure(figsize=(4.6 * len(scenes), 3.8 * len(stops) + 0.5), layout="constrained")
    grid, labels = figure.subplots(len(stops), len(scenes), squeeze=False), []
    for line, stop in zip(grid, stops, strict=True):
        for axis, scene in zip(line, scenes, strict=True):
            panel = worst[(worst.scene == scene) & np.isclose(worst.f_number, stop)]
            labels += _panel(axis, panel, f"{scene}, f/{stop:g}")
    handles = {
        label: handle
        for axis in grid.flat
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)
    }
    figure.legend(
        handles.values(),
        handles,
        loc="outside upper center",
        ncols=min(2, len(scenes)),
        frameon=False,
        fontsize=8,
    )
    figure.supxlabel(
        f"seconds of one core for all planes ({machine})\n"
        "Upper left is better. Grey: the Pareto front. Ring: N = 512, the thesis's recipe.\n"
        "Dotted: what the truth can judge; hollow points are beyond.",
        fontsize=8,
    )
    label_points(figure, labels)
    save_figure(path, figure)


def _panel(axis: Axes, rows: pd.DataFrame, title: str) -> list[PointLabel]:
    """Draw one diagram; returns the labels that its points are to have."""
    log_ticks(axis.xaxis)
    axis.set_title(title, fontsize=10)
    axis.set_ylabel("PSNR of the worst plane, dB", fontsize=9)
    axis.grid(alpha=0.3)
    for goal in GOALS_DB:
        axis.axhline(goal, color="0.85", linewidth=1, zorder=0)
    error = 10 ** (-rows.psnr_true_db.to_numpy(float) / 20)
    front = rows[pareto(error, rows.seconds.to_numpy(float))].sort_values("seconds")
    axis.plot(front.seconds, front.psnr_true_db, color="0.8", linewidth=7, alpha=0.6, zorder=1)
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
        labels += [
            PointLabel(axis, row.seconds, row.psnr_true_db, row.lattice, colour)
            for _, row in curve.iterrows()
        ]
    thesis = rows[(rows.method == NEAREST) & (rows.lattice == THESIS_LATTICE)]
    axis.plot(
        thesis.seconds, thesis.psnr_true_db, "o", color="0.2", markersize=11, fillstyle="none"
    )
    axis.axhline(rows.truth_known_db.min() - BELOW_DB, color="0.4", linestyle=":", linewidth=1)
    axis.margins(x=0.12, y=0.15)
    return labels
