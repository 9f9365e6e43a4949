"""Work-precision diagrams: error across, seconds up, both logarithmic; lower left is better."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from lfcore.evaluation.figures import save_figure
from lfcore.evaluation.work_precision.point import fitted_order

MARKERS = "osD^vP*X"
PINNED = 3.0
"""How far beyond the plotted errors a failed point is pinned, as a factor."""


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
    doubt = measured.reference_rmse.max()
    if np.isfinite(doubt) and doubt > 0:
        axis.axvline(doubt, color="0.4", linestyle=":", linewidth=1)
        axis.annotate(
            "reference's own error", (doubt, 0.02), xycoords=("data", "axes fraction"),
            rotation=90, fontsize=7, color="0.4", ha="right", va="bottom",
        )  # fmt: skip
    axis.legend(frameon=False, fontsize=7)


def _curve(axis, curve: pd.DataFrame, method: str, colour: str, marker: str, low, high) -> None:
    good = curve[(curve.rmse > 0) & curve.seconds.notna()]
    label = method
    if good.order.notna().any():
        fit = good[good.resolved.astype(bool)]
        label += f" (order {fitted_order(np.sqrt(fit.rays_per_pixel), fit.rmse):.2f})"
    axis.plot(good.rmse, good.seconds, "-", color=colour, marker=marker, markersize=5, label=label)
    axis.vlines(good.rmse, good.quartile_1_seconds, good.quartile_3_seconds, color=colour)
    for _, row in good.iterrows():
        label = row.knob.split(", ")[-1].replace("N = ", "")
        axis.annotate(label, (row.rmse, row.seconds),
                      textcoords="offset points", xytext=(4, 4), size=6, color=colour)  # fmt: skip
    failed = curve[curve.rmse.isna()]
    axis.plot([high] * len(failed), [axis.get_ylim()[1]] * len(failed), "x", color=colour)
    exact = curve[curve.rmse == 0]
    axis.plot([low] * len(exact), exact.seconds, "<", color=colour, markersize=7)


def storage(path: str | Path, points: pd.DataFrame) -> None:
    """Error of the refocused picture over the bits a ray takes, one curve a scene."""
    figure = Figure(figsize=(5.6, 4.2), layout="constrained")
    axis = figure.subplots()
    for number, (scene, rows) in enumerate(
        points[points.bits_per_ray.notna()].groupby("scene", sort=False)
    ):
        axis.plot(rows.bits_per_ray, rows.rmse, "o-", color=f"C{number}", label=scene)
        for _, row in rows.iterrows():
            axis.annotate(row.knob.split("CRF ")[-1], (row.bits_per_ray, row.rmse),
                          textcoords="offset points", xytext=(4, 4), fontsize=7)  # fmt: skip
    axis.set(
        xscale="log",
        yscale="log",
        xlabel="bits a ray",
        ylabel="root mean square error, linear light",
    )
    axis.grid(alpha=0.3)
    axis.legend(frameon=False, title="CRF at the points")
    save_figure(path, figure)
