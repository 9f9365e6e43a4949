"""Work-precision diagrams: error across, seconds up, both logarithmic; lower left is better."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from lfcore.evaluation.figures import save_figure
from lfcore.evaluation.work_precision.point import fitted_order
from lfcore.evaluation.work_precision.windows import KINDS

MARKERS = "osD^vP*X"
PINNED = 3.0
"""How far beyond the plotted errors a failed point is pinned, as a factor."""


def draw(panel: str, path: str | Path, points: pd.DataFrame, *, machine: str) -> None:
    """The figure of one panel; ``points`` have columns of kinds of pixels beside the table's."""
    rows = points[points.panel == panel]
    if panel == "storage":
        storage(path, rows, machine=machine)
    elif panel == "convergence":
        convergence(path, points[points.panel == "quadrature"])
    else:
        work_precision(path, rows, machine=machine)


def pareto(error: np.ndarray, seconds: np.ndarray) -> np.ndarray:
    """(K,) bool: points that no other beats in both; failed ones (NaN) never are."""
    better = np.zeros(len(error), bool)
    best = np.inf
    for index in np.lexsort((error, seconds)):
        if np.isfinite(error[index]) and error[index] < best:
            better[index], best = True, error[index]
    return better


def work_precision(path: str | Path, points: pd.DataFrame, *, machine: str) -> None:
    """One panel of diagrams, a column a scene and a row an aperture.

    Parameters
    ----------
    points : rows of one ``panel``.
    machine : what the seconds were measured on.
    """
    scenes = list(dict.fromkeys(points.scene))
    stops = (
        sorted(points.f_number.round(6).unique())
        if points.panel.iloc[0] == "quadrature"
        else [None]
    )
    figure = Figure(figsize=(5.2 * len(scenes), 4.3 * len(stops) + 0.4), layout="constrained")
    grid = figure.subplots(len(stops), len(scenes), squeeze=False)
    for line, stop in zip(grid, stops, strict=True):
        for axis, scene in zip(line, scenes, strict=True):
            rows = points[points.scene == scene]
            if stop is not None:
                rows = rows[np.isclose(rows.f_number, stop)]
            _panel(axis, rows, scene if stop is None else f"{scene}, f/{stop:g}")
    figure.supxlabel(
        f"{machine}\nLower left is better; the grey line joins the Pareto front.", fontsize=9
    )
    save_figure(path, figure)


def _panel(axis, rows: pd.DataFrame, title: str) -> None:
    axis.set(xscale="log", yscale="log")
    axis.set_title(title, fontsize=10)
    axis.set_xlabel("root mean square error, linear light")
    axis.set_ylabel("seconds")
    axis.grid(alpha=0.3)
    measured = rows[(rows.rmse > 0) & rows.seconds.notna()]
    if measured.empty:
        axis.text(0.5, 0.5, "not measured for this scene", transform=axis.transAxes, ha="center")
        return
    front = measured[pareto(measured.rmse.to_numpy(float), measured.seconds.to_numpy(float))]
    front = front.sort_values("rmse")
    axis.plot(front.rmse, front.seconds, color="0.75", linewidth=7, alpha=0.6, zorder=1)
    low, high = measured.rmse.min() / PINNED, measured.rmse.max() * PINNED
    for number, (method, curve) in enumerate(rows.groupby("method", sort=False)):
        _curve(axis, curve, method, f"C{number}", MARKERS[number % len(MARKERS)], low, high)
    doubt = measured.reference_rmse.median()  # peers have references of their own
    if np.isfinite(doubt) and doubt > 0:
        axis.axvline(doubt, color="0.4", linestyle=":", linewidth=1)
        axis.annotate(
            "reference's own error", (doubt, 0.02), xycoords=("data", "axes fraction"),
            rotation=90, fontsize=7, color="0.4", ha="right", va="bottom",
        )  # fmt: skip
    axis.legend(frameon=False, fontsize=7)


def _curve(axis, curve: pd.DataFrame, method: str, colour: str, marker: str, low, high) -> None:
    good = curve[(curve.rmse > 0) & curve.seconds.notna()]
    label = method if len(good) or curve.rmse.notna().any() else f"{method}: left out"
    if good.order.notna().any():
        label += f" (order {fitted_order(np.sqrt(good.rays_per_pixel), good.rmse):.2f})"
    axis.plot(good.rmse, good.seconds, "-", color=colour, marker=marker, markersize=5, label=label)
    axis.vlines(good.rmse, good.quartile_1_seconds, good.quartile_3_seconds, color=colour)
    for _, row in good.iterrows():
        label = row.knob.split(", ")[-1].replace("N = ", "")
        axis.annotate(label, (row.rmse, row.seconds),
                      textcoords="offset points", xytext=(4, 4), size=6, color=colour)  # fmt: skip
    failed = curve[curve.rmse.isna() & ~curve.knob.str.startswith("left out")]
    for place, (_, row) in enumerate(failed.iterrows()):
        at = 1 - 0.04 * (place + 1)
        axis.plot(0.985, at, "x", color=colour, transform=axis.transAxes, clip_on=False)
        label = row.knob.split(", ")[-1].replace("N = ", "")
        axis.annotate(f"{method} {label}: refused", (0.97, at), xycoords="axes fraction", size=6,
                      ha="right", va="center", color=colour)  # fmt: skip
    exact = curve[curve.rmse == 0]
    axis.plot([low] * len(exact), exact.seconds, "<", color=colour, markersize=7)


def storage(path: str | Path, points: pd.DataFrame, *, machine: str) -> None:
    """Error of the picture through the lens, over bits a ray and over seconds of encoding.

    ``points`` are rows of the panel ``storage``; the front is grey, CRF stands at the points.
    """
    points = points[points.rmse > 0]
    scenes = list(dict.fromkeys(points.scene))
    figure = Figure(figsize=(5.2 * len(scenes), 8.8), layout="constrained")
    grid = figure.subplots(2, len(scenes), squeeze=False)
    costs = (("bits_per_ray", "bits a ray"), ("seconds", "seconds of encoding"))
    for line, (column, label) in zip(grid, costs, strict=True):
        for axis, scene in zip(line, scenes, strict=True):
            rows = points[points.scene == scene]
            front = rows[pareto(rows.rmse.to_numpy(float), rows[column].to_numpy(float))]
            front = front.sort_values("rmse")
            axis.plot(front[column], front.rmse, color="0.75", linewidth=7, alpha=0.6, zorder=1)
            for number, (method, curve) in enumerate(rows.groupby("method", sort=False)):
                _cost(axis, curve, column, method, f"C{number}", MARKERS[number])
            axis.set(xscale="log", yscale="log", xlabel=label)
            axis.set_title(scene, fontsize=10)
            axis.grid(alpha=0.3)
        line[0].set_ylabel("root mean square error, linear light")
        line[0].legend(frameon=False, fontsize=7)
    figure.supxlabel(
        f"{machine}\nLower left is better; the grey line joins the Pareto front.", fontsize=9
    )
    save_figure(path, figure)


def _cost(axis, curve: pd.DataFrame, column: str, method: str, colour: str, marker: str) -> None:
    axis.plot(
        curve[column], curve.rmse, "-", color=colour, marker=marker, markersize=4, label=method
    )
    for _, row in curve.iterrows():
        axis.annotate(row.knob.replace("CRF ", ""), (row[column], row.rmse),
                      textcoords="offset points", xytext=(4, 4), size=6, color=colour)  # fmt: skip
    if column == "seconds":
        axis.hlines(curve.rmse, curve.quartile_1_seconds, curve.quartile_3_seconds, color=colour)


def convergence(path: str | Path, rows: pd.DataFrame) -> None:
    """Error over N by kind of pixel at the widest aperture, a row a scene and a column a kind.

    ``rows`` are points of the panel ``quadrature`` with columns ``rmse_<kind>``.  Grey lines fall
    with N^-1, N^-1.5 and N^-2.
    """
    rows = rows[rows.f_number == rows.groupby("scene").f_number.transform("min")]
    scenes, kinds = list(dict.fromkeys(rows.scene)), ("all", *KINDS)
    figure = Figure(figsize=(3.0 * len(kinds), 3.0 * len(scenes)), layout="constrained")
    grid = figure.subplots(len(scenes), len(kinds), squeeze=False)
    for line, scene in zip(grid, scenes, strict=True):
        for axis, kind in zip(line, kinds, strict=True):
            _converging(axis, rows[rows.scene == scene], kind)
            axis.set_title(f"{scene}, {kind}", fontsize=9)
        line[0].set_ylabel("root mean square error")
    for axis in grid[-1]:
        axis.set_xlabel("N")
    grid[0][0].legend(frameon=False, fontsize=7)
    save_figure(path, figure)


def _converging(axis, rows: pd.DataFrame, kind: str) -> None:
    column = "rmse" if kind == "all" else f"rmse_{kind}"
    axis.set(xscale="log", yscale="log")
    axis.grid(alpha=0.3)
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
