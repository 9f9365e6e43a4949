"""Diagrams of error against cost: Pareto fronts, and labels that cover nothing else."""

import itertools
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox
from numpy.typing import ArrayLike

from lfcore.evaluation.figures import save_figure

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


def save_diagrams(
    path: str | Path, figure: Figure, labels: Iterable[PointLabel], caption: str
) -> None:
    """Write the ``caption`` below all diagrams, the labels where there is room, and the figure."""
    figure.supxlabel(caption, fontsize=8)
    label_points(figure, labels)
    save_figure(path, figure)


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
