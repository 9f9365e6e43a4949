"""Error against run time: dB against the true picture over core seconds; upper left is better."""

import itertools
from collections.abc import Iterable, Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox
from numpy.typing import ArrayLike

from lfcore.evaluation.figures import log_ticks, save_figure
from lfcore.evaluation.true_picture import BELOW_DB
from lfcore.evaluation.work_precision.points import FROM_FILE, IN_MEMORY, ON_THE_FLY

MARKERS = "osD^vP*X"
FRONT: dict[str, Any] = {"color": "0.75", "linewidth": 7, "alpha": 0.6, "zorder": 1}
"""The style of the line that joins a Pareto front."""
DISTANCES_PT = (4, 8, 13, 19, 26)
SIZE_PT = 6
MARKER_PT = 3.0
"""Half the side of a marker, in points."""
PIXELS_OF_A_GAP, BETWEEN_PIXELS = 1.0, 3.0
DIRECTIONS = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))
NOT_DRAWN = ("None", "", " ")
"""The line styles and markers that draw nothing."""


class PointLabel(NamedTuple):
    """``text`` for the point (x, y) of ``axis``, in data coordinates."""

    axis: Axes
    x: float
    y: float
    text: str
    colour: str


def pareto(error: ArrayLike, cost: ArrayLike) -> np.ndarray:
    """(K,) bool: points that no other beats in both; failed ones (NaN) never are."""
    error = np.asarray(error, float)
    better = np.zeros(len(error), bool)
    best = np.inf
    for index in np.lexsort((error, np.asarray(cost, float))):
        if np.isfinite(error[index]) and error[index] < best:
            better[index], best = True, error[index]
    return better


def label_points(figure: Figure, labels: Iterable[PointLabel]) -> list[Annotation]:
    """Write each label as near to its point as there is room; labels without room are left out.

    Everything else must be drawn before, since the layout is then fixed.  Returns the labels
    written.
    """
    FigureCanvasAgg(figure)  # one renderer for all boxes
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # the layout stays
    written: list[Annotation] = []
    occupied: dict[Axes, tuple[list[Bbox], np.ndarray]] = {}
    for label in labels:
        if label.axis not in occupied:
            occupied[label.axis] = _occupied(label.axis)
        taken, curves = occupied[label.axis]
        note = _placed(label, taken, curves)
        if note is not None:
            written.append(note)
            taken.append(note.get_window_extent())
    return written


def _occupied(axis: Axes) -> tuple[list[Bbox], np.ndarray]:
    """Boxes of points, texts and legend, and (K, 2) points along curves and bars, in pixels."""
    half = MARKER_PT * axis.figure.dpi / 72
    boxes = [text.get_window_extent() for text in axis.texts if text.get_text()]
    if (legend := axis.get_legend()) is not None:
        boxes.append(legend.get_window_extent())
    chains = []
    for line in axis.lines:
        points = line.get_transform().transform(np.asarray(line.get_xydata(), float))
        points = points[np.isfinite(points).all(axis=1)]
        if line.get_marker() not in NOT_DRAWN:
            boxes += [Bbox([point - half, point + half]) for point in points]
        if line.get_linestyle() not in NOT_DRAWN:
            chains.append(points)
    for bars in axis.collections:  # of quartiles
        if isinstance(bars, LineCollection):
            parts = (axis.transData.transform(part) for part in bars.get_segments() if len(part))
            chains += [part[np.isfinite(part).all(axis=1)] for part in parts]
    along = [np.empty((0, 2))]
    for start, end in itertools.chain.from_iterable(map(itertools.pairwise, chains)):
        steps = 2 + int(np.hypot(*(end - start)) / BETWEEN_PIXELS)
        along.append(np.linspace(start, end, steps))
    return boxes, np.concatenate(along)


def _placed(label: PointLabel, taken: list[Bbox], curves: np.ndarray) -> Annotation | None:
    """The label at the nearest free place around its point, on a curve if there is no other."""
    room = label.axis.get_window_extent()
    note = label.axis.annotate(
        label.text, (label.x, label.y), xytext=(0, 0), textcoords="offset points",
        size=SIZE_PT, color=label.colour, ha="center", va="center",
    )  # fmt: skip
    at = note.get_window_extent()
    scale = label.axis.figure.dpi / 72
    # The label's edge, and not its middle, is so far from the point.
    half = np.array([at.width, at.height]) / 2 / scale
    on_a_curve: np.ndarray | None = None
    for distance, direction in itertools.product(DISTANCES_PT, DIRECTIONS):
        move = np.array(direction) * (distance + half)
        box = at.translated(*(move * scale)).padded(PIXELS_OF_A_GAP)
        inside = room.x0 <= box.x0 and box.x1 <= room.x1
        inside &= room.y0 <= box.y0 and box.y1 <= room.y1
        if not inside or any(box.overlaps(other) for other in taken):
            continue
        if not ((curves > box.min) & (curves < box.max)).all(axis=1).any():
            break
        on_a_curve = move if on_a_curve is None else on_a_curve
    else:
        if on_a_curve is None:
            note.remove()
            return None
        move = on_a_curve
    note.set_position(tuple(move))
    return note


GUIDE_DB = 10.0
"""The slope of independent samples: ten times the time has a tenth of the squared error."""
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
    _draw(path, machine, [one for one in diagrams if len(one.points)])


def _draw(path: str | Path, machine: str, diagrams: Sequence[Diagram]) -> None:
    scenes = pd.concat([one.points for one in diagrams]).scene.unique()
    size = (COLUMN_INCHES * max(2, len(scenes)), ROW_INCHES * len(diagrams) + 0.5)
    figure = Figure(figsize=size)
    axes = figure.subplots(len(diagrams), len(scenes), squeeze=False)
    labels: list[PointLabel] = []
    for (diagram, scene), axis in zip(product(diagrams, scenes), axes.flat, strict=True):
        methods = list(diagram.points.method.unique())
        rows = diagram.points[diagram.points.scene == scene]
        labels += _panel(axis, rows, diagram.seconds, methods)
        axis.set_title(f"{scene}, {diagram.title}", fontsize=10)
    for line in axes:
        line[0].set_ylabel("PSNR of the worst plane (dB)")
    caption = (
        f"core seconds for all planes ({machine})\n"
        "Upper left is better. Grey band: Pareto front. Dashed: slope of independent samples, "
        f"{GUIDE_DB:g} dB per tenfold time.\n"
        "Dotted: the true picture judges what is below; hollow points are above."
    )
    figure.supxlabel(caption, fontsize=8)
    label_points(figure, labels)
    save_figure(path, figure)


def _panel(axis: Axes, rows: pd.DataFrame, time: str, methods: list[str]) -> list[PointLabel]:
    """Draw one diagram; returns the labels of its points."""
    shown = rows.psnr_true_db.astype(float).fillna(rows.expected_db.astype(float))
    rows = rows.assign(shown_db=shown, x=rows[time].astype(float))
    _say_missing(axis, rows[rows.x.isna()])
    rows = rows[rows.x.notna()]
    if rows.empty:
        axis.text(0.5, 0.5, "not measured", transform=axis.transAxes, ha="center")
        return []
    log_ticks(axis.xaxis)
    axis.tick_params(labelsize=8)
    front = rows[pareto(-rows.shown_db, rows.x)].sort_values("x")
    axis.plot(front.x, front.shown_db, **FRONT)
    labels = []
    for method, curve in rows.groupby("method", sort=False):
        labels += _curve(axis, curve, str(method), methods.index(str(method)), time)
    known = rows.truth_known_db.astype(float).min() - BELOW_DB
    if known < rows.shown_db.max() + 5:
        axis.axhline(known, color="0.4", linestyle=":", linewidth=1)
    axis.margins(x=0.1, y=0.12)
    _guide(axis, rows)
    axis.legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=2)
    return labels


def _curve(
    axis: Axes, curve: pd.DataFrame, method: str, number: int, time: str
) -> list[PointLabel]:
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
    each = zip(curve.x, curve.shown_db, curve.setting, strict=True)
    return [PointLabel(axis, x, y, _short(setting), colour) for x, y, setting in each]


def _short(setting: str) -> str:
    for words in ("N = ", "CRF "):
        setting = setting.replace(words, "")
    return setting


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
