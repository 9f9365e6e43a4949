"""All cases in the report's order: table, bounds, heat map and error growth."""

import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from lfcore.errors import check_known
from lfcore.evaluation.figures import save_figure
from lfcore.evaluation.stability import light, primitives, specular
from lfcore.evaluation.stability.measurement import Case, Measurement, StabilityError

DECADES = 3
"""The decades from its bound at which an error's colour saturates."""
SIGNS = {"refused": "r", "fail": "×"}
OURS, NAIVE = "#1f6f8b", "#c8553d"
COLOURS = LinearSegmentedColormap.from_list("bound", [OURS, "#e8f1f2", "#f6e3c5", "#b3261e"])


CASES: tuple[Case, ...] = (
    primitives.edge_rays, primitives.vertex_rays, primitives.any_vertex_rays,
    primitives.triangle_sizes, primitives.far_from_the_origin, primitives.long_rays,
    primitives.tiny_triangles, primitives.large_triangles,
    primitives.scaled_scene, primitives.far_sphere,
    primitives.needles, primitives.nearly_coplanar, primitives.grazing,
    primitives.axes, primitives.any_axes, primitives.flat_boxes,
    light.self_shadow, light.far_self_shadow, light.thin_gap, light.thin_gap_far,
    light.bright_texel, light.closed_room, light.albedo, light.slit, light.scaled_light,
    specular.grazing_glass, specular.nested_glass, specular.touching_glass, specular.index_1,
    specular.thin_slab, specular.scaled_mirror, specular.facing_mirrors,
)  # fmt: skip


def chosen(names: str | Iterable[str]) -> tuple[Case, ...]:
    """The cases of these names, or ``all``.

    Raises :class:`StabilityError` for a name that no case has.
    """
    by_name = {case.__name__: case for case in CASES}
    if names == "all":
        return CASES
    for name in names:
        check_known(StabilityError, "analysis.stability_cases", name, by_name, "stability sweep")
    return tuple(by_name[name] for name in names)


def stability_table(measurements: Iterable[Measurement]) -> pd.DataFrame:
    """Rows of all fields and the verdict, in the order of running."""
    return pd.DataFrame(
        [{**vars(measurement), "verdict": measurement.verdict} for measurement in measurements]
    )


def cases_table(table: pd.DataFrame) -> pd.DataFrame:
    """A row per case: its sweep, largest condition number, bound and origin of the bound."""
    verdict = {name: table.verdict == name for name in ("pass", "refused", "fail")}
    grouped = table.assign(**verdict).groupby("case", sort=False)
    return grouped.agg(
        number=("number", "first"),
        parameter=("parameter", "first"),
        least=("value", "min"),
        most=("value", "max"),
        condition_number=("condition", "max"),
        unit=("unit", "first"),
        bound=("bound", "max"),
        bound_from=("bound_from", "first"),
        naive_worst=("naive_error", "max"),
        worst=("error", "max"),
        passed=("pass", "sum"),
        refused=("refused", "sum"),
        failed=("fail", "sum"),
    ).reset_index()


def summary(table: pd.DataFrame) -> str:
    """A sentence with the number of rows per verdict."""
    counts = table.verdict.value_counts()
    return ", ".join(f"{counts[name]} {name}" for name in counts.index)


def _excess(error: pd.Series, bound: pd.Series) -> np.ndarray:
    """The error over its bound in decades, saturated; a bound of 0 allows no error."""
    with np.errstate(divide="ignore", invalid="ignore"):
        decades = np.log10(error.to_numpy(float) / bound.to_numpy(float))
    return np.where(error == 0, -DECADES, np.clip(decades, -DECADES, DECADES))


def heat_map(path: str | Path, table: pd.DataFrame) -> None:
    """Every row as a cell, cases down and the sweep across, naive float32 beside lfcore."""
    lines, cases = pd.factorize(table.case)
    steps = table.groupby("case").cumcount().to_numpy()
    width = steps.max() + 1
    figure = Figure(figsize=(11, 0.23 * len(cases) + 1.6))
    axes = figure.subplots(1, 2, sharey=True)
    for axis, column, title in zip(
        axes, ("naive_error", "error"), ("naive float32", "lfcore"), strict=True
    ):
        cells = np.full((len(cases), width), np.nan)
        cells[lines, steps] = _excess(table[column], table.bound)
        image = axis.imshow(cells, cmap=COLOURS, vmin=-DECADES, vmax=DECADES, aspect="auto")
        axis.set_title(title)
        axis.set_xlabel("step of the sweep")
        axis.set_xticks(range(0, width, 2), range(1, width + 1, 2))
        axis.grid(False)
        axis.tick_params(length=0)
        axis.spines[:].set_visible(False)
    for line, step, verdict in zip(lines, steps, table.verdict, strict=True):
        if verdict in SIGNS:
            axes[1].text(step, line, SIGNS[verdict], ha="center", va="center", fontsize=8)
    axes[0].set_yticks(range(len(cases)), cases, fontsize=8)
    figure.colorbar(image, ax=axes, shrink=0.5, label="log10 of error / bound")
    figure.supxlabel(
        "r: refused with a reason, outside the documented range     ×: failed", fontsize=9
    )
    save_figure(path, figure)


def error_growth(path: str | Path, table: pd.DataFrame) -> None:
    """Error over the stiffness parameter of some cases, lfcore and naive, with the bound."""
    cases = _growing(table)
    columns = min(4, len(cases))
    lines = math.ceil(len(cases) / columns)
    figure = Figure(figsize=(3.5 * columns, 2.9 * lines))
    axes = np.atleast_1d(figure.subplots(lines, columns)).ravel()
    for axis, case in zip(axes, cases, strict=False):
        _growth(axis, table[table.case == case], case)
    for axis in axes[len(cases) :]:
        axis.set_visible(False)
    axes[0].legend(fontsize=8)
    save_figure(path, figure)


def _growing(table: pd.DataFrame) -> list[str]:
    """Cases with a sweep of at least four values over decades whose naive error grows most."""
    growth: dict[str, float] = {}
    for case, rows in table.groupby("case", sort=False):
        naive = rows.naive_error[np.isfinite(rows.naive_error) & (rows.naive_error > 0)]
        values = rows.value[rows.value > 0]
        if len(naive) >= 3 and values.nunique() >= 4 and values.max() > 10 * values.min():
            growth[str(case)] = math.log10(naive.max() / naive.min())
    return sorted(growth, key=growth.__getitem__, reverse=True)[:8]


def _growth(axis: Axes, rows: pd.DataFrame, case: str) -> None:
    rows = rows[(rows.value > 0) & np.isfinite(rows.value)].sort_values("value")
    shown = np.concatenate([rows.naive_error, rows.error, rows.bound])
    shown = shown[np.isfinite(shown) & (shown > 0)]
    floor, top = shown.min() / 10, shown.max() * 10
    for column, style, colour, label in (
        ("naive_error", "x--", NAIVE, "naive float32"),
        ("error", "o-", OURS, "lfcore"),
    ):
        values = rows[column].clip(floor, top)
        axis.plot(rows.value, values, style, color=colour, label=label, markersize=4, clip_on=False)
    if (rows.bound > 0).any():
        axis.plot(rows.value, rows.bound.where(rows.bound > 0), ":", color="0.4", label="bound")
    axis.set(xscale="log", yscale="log", ylim=(floor, top))
    axis.minorticks_off()  # over tens of decades, they take longer than the rest
    axis.set_title(case, fontsize=9)
    axis.set_xlabel(rows.parameter.iloc[0], fontsize=8)
    axis.tick_params(labelsize=7)
