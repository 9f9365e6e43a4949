"""Work-precision diagrams: error across, seconds up, both logarithmic; lower left is better."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from lfcore.evaluation.diagrams import FRONT, MARKERS, PointLabel, pareto, save_diagrams
from lfcore.evaluation.figures import log_ticks, save_figure
from lfcore.evaluation.work_precision.convergence import error_column, fitted_order
from lfcore.evaluation.work_precision.measured_point import TIMES_BELOW
from lfcore.evaluation.work_precision.windows import KINDS

PINNED = 3.0
"""How far beyond the plotted errors what has none is pinned, as a factor."""
COSTS = {
    "bytes": "kilobytes of the file",
    "seconds": "seconds of encoding",
    "read_seconds": "seconds of reading: decoding and forming the picture",
}
ERROR = "root mean square error, linear light"
CAPTION = "Lower left is better; the grey line joins the Pareto front."


def draw(panel: str, path: str | Path, points: pd.DataFrame, *, machine: str) -> None:
    """The figure of one panel; ``points`` have columns of kinds of pixels beside the table's."""
    rows = points[points.panel == panel]
    if panel == "storage":
        storage(path, rows, machine=machine)
    elif panel == "convergence":
        convergence(path, points[points.panel == "quadrature"])
    else:
        work_precision(path, rows, machine=machine)


def work_precision(path: str | Path, points: pd.DataFrame, *, machine: str) -> None:
    """One panel of diagrams, a column a scene and a row an aperture.

    Parameters
    ----------
    points : rows of one ``panel``.
    machine : what the seconds were measured on.
    """
    scenes, stops = points.scene.unique(), [None]
    if points.panel.iloc[0] == "quadrature":
        stops = sorted(points.f_number.round(6).unique())
    figure = Figure(figsize=(5.2 * len(scenes), 4.3 * len(stops) + 0.4))
    axes = figure.subplots(len(stops), len(scenes), squeeze=False).flat
    labels = []
    for axis, (stop, scene) in zip(axes, product(stops, scenes), strict=True):
        rows = points[points.scene == scene]
        if stop is not None:
            rows = rows[np.isclose(rows.f_number, stop)]
        labels += _panel(axis, rows)
        axis.set_title(scene if stop is None else f"{scene}, f/{stop:g}", fontsize=10)
    caption = f"{machine}\n{CAPTION}\n"
    caption += "Hollow: what the reference cannot judge; its error is at most this."
    save_diagrams(path, figure, labels, caption)


def _panel(axis: Axes, rows: pd.DataFrame) -> list[PointLabel]:
    """Draw one diagram; returns the labels that its points are to have."""
    log_ticks(axis.xaxis)
    log_ticks(axis.yaxis)
    axis.set(xlabel=ERROR, ylabel="seconds")
    measured = rows[rows.seconds.notna() & (rows.rmse > 0)]
    if measured.empty:
        axis.text(0.5, 0.5, "not measured for this scene", transform=axis.transAxes, ha="center")
        return []
    front = measured[pareto(measured.rmse, measured.seconds)].sort_values("rmse")
    axis.plot(front.rmse, front.seconds, **FRONT)
    labels: list[PointLabel] = []
    for number, (method, curve) in enumerate(rows.groupby("method", sort=False)):
        labels += _curve(axis, curve, str(method), f"C{number}", MARKERS[number % len(MARKERS)])
    for _, row in rows[rows.rmse == 0].iterrows():
        axis.plot(
            measured.rmse.min() / PINNED, row.seconds, "<", color="0.3", markersize=7,
            label=f"{row.method}: exact",
        )  # fmt: skip
    axis.margins(x=0.08, y=0.08)
    _limit(axis, measured)
    _refused(axis, rows)
    axis.legend(fontsize=7, loc="upper left", bbox_to_anchor=(0, -0.13), ncols=2)
    return labels


def _limit(axis: Axes, measured: pd.DataFrame) -> None:
    """How small an error the reference can tell, where points come near that; peers have
    references of their own."""
    least = TIMES_BELOW * measured.reference_rmse.median()
    if least > axis.get_xlim()[0]:
        axis.axvline(least, color="0.4", linestyle=":", linewidth=1)
        axis.annotate(
            "what can be judged", (least, 0.02), xycoords=("data", "axes fraction"),
            rotation=90, fontsize=7, color="0.4", ha="right", va="bottom",
        )  # fmt: skip


def _curve(
    axis: Axes, curve: pd.DataFrame, method: str, colour: str, marker: str
) -> list[PointLabel]:
    timed = curve[curve.seconds.notna() & (curve.rmse.isna() | (curve.rmse > 0))]
    # What cannot be judged stands where errors begin that can: it is no farther right.
    error = timed.rmse.fillna(timed.reference_rmse * TIMES_BELOW)
    good = timed.rmse.notna()
    if timed.empty:
        return []
    if timed.order.notna().any():
        order = fitted_order(np.sqrt(timed.rays_per_pixel[good]), timed.rmse[good])
        method += f" (order {order:.2f})"
    style: dict[str, Any] = {"color": colour, "marker": marker, "markersize": 5}
    axis.plot(error[good], timed.seconds[good], "-", label=method, **style)
    axis.plot(error[~good], timed.seconds[~good], linestyle="", markerfacecolor="none", **style)
    axis.vlines(error, timed.quartile_1_seconds, timed.quartile_3_seconds, color=colour)
    return _labels(axis, error, timed.seconds, timed.knob, colour)


def _labels(
    axis: Axes, x: pd.Series, y: pd.Series, knob: pd.Series, colour: str
) -> list[PointLabel]:
    each = zip(x, y, knob, strict=True)
    return [PointLabel(axis, x, y, _short(knob), colour) for x, y, knob in each]


def _short(knob: str) -> str:
    for words in ("N = ", "CRF ", " samples"):
        knob = knob.replace(words, "")
    return knob


def _refused(axis: Axes, rows: pd.DataFrame) -> None:
    """What has no seconds, in words: settings that were refused, renderers that are not there."""
    lines = []
    for method, curve in rows[rows.seconds.isna()].groupby("method", sort=False):
        settings = ", ".join(filter(None, (_short(knob) for knob in curve.knob)))
        why = "; ".join(dict.fromkeys(note.split(":")[0] for note in curve.note.fillna("refused")))
        lines.append(f"{method} {settings}: {why}".replace(" :", ":"))
    axis.text(
        0.985, 0.985, "\n".join(lines), transform=axis.transAxes, size=6, ha="right", va="top",
        color="0.3",
    )  # fmt: skip


def storage(path: str | Path, points: pd.DataFrame, *, machine: str) -> None:
    """Error of the picture through the lens, over bytes and seconds of encoding and of reading.

    ``points`` are rows of the panel ``storage``; the front is grey, CRF stands at the points.
    """
    points = points[points.rmse > 0]
    scenes = points.scene.unique()
    figure = Figure(figsize=(5.2 * len(scenes), 12.6))
    axes = figure.subplots(len(COSTS), len(scenes), squeeze=False)
    labels = []
    for axis, (cost, scene) in zip(axes.flat, product(COSTS, scenes), strict=True):
        rows = points[points.scene == scene]
        front = rows[pareto(rows.rmse, rows[cost])].sort_values("rmse")
        axis.plot(front[cost], front.rmse, **FRONT)
        for number, (method, curve) in enumerate(rows.groupby("method", sort=False)):
            colour, at = f"C{number}", curve[cost]
            axis.plot(
                at, curve.rmse, color=colour, marker=MARKERS[number], markersize=4, label=method
            )
            if cost == "seconds":
                quartiles = curve.quartile_1_seconds, curve.quartile_3_seconds
                axis.hlines(curve.rmse, *quartiles, color=colour)
            labels += _labels(axis, at, curve.rmse, curve.knob, colour)
        log_ticks(axis.xaxis, 1e3 if cost == "bytes" else 1.0)
        log_ticks(axis.yaxis)
        axis.set_xlabel(COSTS[cost])
        axis.set_title(scene, fontsize=10)
        axis.margins(x=0.08, y=0.08)
    for axis in axes[:, 0]:
        axis.set_ylabel(ERROR)
    legend = axes[0, 0].get_legend_handles_labels()
    figure.legend(*legend, loc="outside upper center", ncols=3, fontsize=8)
    save_diagrams(path, figure, labels, f"{machine}\n{CAPTION}")


def convergence(path: str | Path, rows: pd.DataFrame) -> None:
    """Error over N by kind of pixel at the widest aperture, a row a scene and a column a kind.

    ``rows`` are points of the panel ``quadrature`` with columns ``rmse_<kind>``.  Grey lines fall
    with N^-1, N^-1.5 and N^-2.
    """
    rows = rows[rows.f_number == rows.groupby("scene").f_number.transform("min")]
    scenes, kinds = rows.scene.unique(), ("all", *KINDS)
    figure = Figure(figsize=(3.0 * len(kinds), 3.0 * len(scenes)))
    axes = figure.subplots(len(scenes), len(kinds), squeeze=False)
    for axis, (scene, kind) in zip(axes.flat, product(scenes, kinds), strict=True):
        _converging(axis, rows[rows.scene == scene], error_column(kind))
        axis.set_title(f"{scene}, {kind}", fontsize=9)
    for axis in axes[:, 0]:
        axis.set_ylabel("root mean square error")
    for axis in axes[-1]:
        axis.set_xlabel("N")
    axes[0, 0].legend(fontsize=7)
    save_figure(path, figure)


def _converging(axis: Axes, rows: pd.DataFrame, column: str) -> None:
    axis.set(xscale="log", yscale="log")
    if column not in rows or not (rows[column] > 0).any():
        axis.text(0.5, 0.5, "no such pixels", transform=axis.transAxes, ha="center", fontsize=8)
        return
    for number, (method, curve) in enumerate(rows.groupby("method", sort=False)):
        curve = curve[curve[column] > 0]
        side = np.sqrt(curve.rays_per_pixel)
        axis.plot(side, curve[column], marker=MARKERS[number], markersize=4, label=method)
    axis.xaxis.set_minor_formatter(NullFormatter())
    low, high = np.sqrt([rows.rays_per_pixel.min(), rows.rays_per_pixel.max()])
    top = rows[column].max()
    for order in (1, 1.5, 2):
        axis.plot([low, high], [top, top * (high / low) ** -order], color="0.8", zorder=0)
        axis.annotate(f"-{order:g}", (high, top * (high / low) ** -order), size=6, color="0.5")
