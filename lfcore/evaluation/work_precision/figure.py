"""Error against run time: dB against the true picture over core seconds; upper left is better."""

import re
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from lfcore.evaluation.figures import log_ticks, save_figure
from lfcore.evaluation.true_picture import BELOW_DB
from lfcore.evaluation.work_precision.points import FROM_FILE, IN_MEMORY, ON_THE_FLY

MARKERS = "osD^vP*X"
FRONT: dict[str, Any] = {"color": "0.75", "linewidth": 7, "alpha": 0.6, "zorder": 1}
"""The style of the line that joins a Pareto front."""
BESIDE: dict[str, Any] = {
    "xytext": (-3, 2), "textcoords": "offset points", "size": 6, "ha": "right", "va": "bottom",
}  # fmt: skip
"""The place and size of a setting, to the upper left of its point."""


def pareto(error: ArrayLike, cost: ArrayLike) -> np.ndarray:
    """(K,) bool: points that no other point beats in both; never for failed points (NaN)."""
    error = np.asarray(error, float)
    order, better = np.lexsort((error, np.asarray(cost, float))), np.zeros(len(error), bool)
    best = np.fmin.accumulate(np.append(np.inf, error[order]))
    better[order] = best[1:] < best[:-1]
    return better


GUIDE_DB = 10.0
"""The slope of independent samples, dB per decade: ten times the time, a tenth of the squared
error."""
GUIDE: dict[str, Any] = {"color": "0.6", "linestyle": "--", "linewidth": 1, "zorder": 0}
COLUMN_INCHES, ROW_INCHES = 4.9, 4.6


class Diagram(NamedTuple):
    """A row of the figure: the points, the column of their seconds, and the titles."""

    points: pd.DataFrame
    seconds: str
    title: str


def on_the_fly(path: str | Path, points: pd.DataFrame, *, machine: str) -> None:
    """Draw the pictures formed while tracing: a row per aperture, a column per scene."""
    rows = points[points.panel == ON_THE_FLY]
    stops = sorted(rows.f_number.unique())
    _draw(
        path, machine,
        [
            Diagram(rows[np.isclose(rows.f_number.astype(float), stop)], "seconds",
                    f"on the fly, f/{stop:.3g}")
            for stop in stops
        ],
    )  # fmt: skip


def stored(path: str | Path, points: pd.DataFrame, *, machine: str) -> None:
    """Draw the pictures from light fields: recording and reading files, and views in memory."""
    files, memory = (points[points.panel == name] for name in (FROM_FILE, IN_MEMORY))
    diagrams = [
        Diagram(files, "record_seconds", "recording a file"),
        Diagram(files, "seconds", "all planes from the file"),
        Diagram(memory, "seconds", "all planes from memory"),
    ]
    _draw(path, machine, [diagram for diagram in diagrams if len(diagram.points)])


def _draw(path: str | Path, machine: str, diagrams: Sequence[Diagram]) -> None:
    scenes = pd.concat([row.points for row in diagrams]).scene.unique()
    size = (COLUMN_INCHES * max(2, len(scenes)), ROW_INCHES * len(diagrams) + 0.5)
    figure = Figure(figsize=size)
    axes = figure.subplots(len(diagrams), len(scenes), squeeze=False)
    for (diagram, scene), axis in zip(product(diagrams, scenes), axes.flat, strict=True):
        methods = list(diagram.points.method.unique())
        rows = diagram.points[diagram.points.scene == scene]
        _panel(axis, rows, diagram.seconds, methods)
        axis.set_title(f"{scene}, {diagram.title}", fontsize=10)
        axis.set_xlabel("core seconds", fontsize=8)
        axis.set_ylabel("PSNR of the worst plane (dB)", fontsize=8)
    caption = (
        f"{machine}. Upper left is better. Grey band: Pareto front, with its settings.\n"
        f"Dashed: slope of independent samples, {GUIDE_DB:g} dB per tenfold time. "
        "Dotted: the true picture judges what is below; hollow points are above."
    )
    figure.supxlabel(caption, fontsize=8)
    save_figure(path, figure)


def _panel(axis: Axes, rows: pd.DataFrame, time: str, methods: list[str]) -> None:
    shown = rows.psnr_true_db.astype(float).fillna(rows.expected_db.astype(float))
    rows = rows.assign(shown_db=shown, x=rows[time].astype(float))
    _say_missing(axis, rows[rows.x.isna()])
    rows = rows[rows.x.notna()]
    if rows.empty:
        axis.text(0.5, 0.5, "not measured", transform=axis.transAxes, ha="center")
        return
    log_ticks(axis)
    axis.tick_params(labelsize=8)
    front = rows[pareto(-rows.shown_db, rows.x)].sort_values("x")
    axis.plot(front.x, front.shown_db, **FRONT)
    for point in front.itertuples():  # no other point is to the upper left
        setting = re.sub("N = |CRF ", "", point.setting)
        axis.annotate(setting, (point.x, point.shown_db), **BESIDE)
    for method, curve in rows.groupby("method", sort=False):
        _curve(axis, curve, str(method), methods.index(str(method)), time)
    limit_db = rows.truth_known_db.astype(float).min() - BELOW_DB
    if limit_db < rows.shown_db.max() + 5:
        axis.axhline(limit_db, color="0.4", linestyle=":", linewidth=1)
    axis.margins(x=0.1, y=0.12)
    _guide(axis, rows)
    axis.legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=2)


def _curve(axis: Axes, curve: pd.DataFrame, method: str, number: int, time: str) -> None:
    colour = f"C{number}"
    style: dict[str, Any] = {"color": colour, "marker": MARKERS[number % len(MARKERS)]}
    judged = ~curve.note.fillna("").str.startswith("not judged")
    axis.plot(curve.x, curve.shown_db, "-", color=colour, linewidth=1.2)
    axis.plot([], [], label=method, markersize=4, **style)
    for some, face in ((curve[judged], colour), (curve[~judged], "white")):
        axis.plot(some.x, some.shown_db, linestyle="", markersize=4, markerfacecolor=face, **style)
    if time == "seconds":
        low, high = (curve[f"quartile_{n}_seconds"].astype(float) for n in (1, 3))
        axis.hlines(curve.shown_db, low, high, color=colour, linewidth=1)


def _guide(axis: Axes, rows: pd.DataFrame) -> None:
    """Lines of the slope of independent samples, without a change of the axes' limits."""
    low, high = axis.get_xlim()
    bottom, top = axis.get_ylim()
    start = rows.loc[rows.x.idxmin()]
    x = np.array([low, high])
    axis.plot(x, start.shown_db + GUIDE_DB * np.log10(x / start.x), **GUIDE)
    axis.set(xlim=(low, high), ylim=(bottom, top))


def _say_missing(axis: Axes, rows: pd.DataFrame) -> None:
    """The methods without seconds, with the reason: refused, or not installed."""
    lines = [
        f"{method}: {'; '.join(dict.fromkeys(some.note.fillna('')))}"
        for method, some in rows.groupby("method", sort=False)
    ]
    axis.text(
        0.985, 0.015, "\n".join(lines), transform=axis.transAxes, size=6, ha="right", va="bottom",
        color="0.3",
    )  # fmt: skip
