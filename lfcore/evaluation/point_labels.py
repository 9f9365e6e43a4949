"""Labels at the points of diagrams that cover neither one another nor other points."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox

DISTANCES_PT = (4, 8, 13, 19, 26)
SIZE_PT = 6
MARKER_PT = 3.0
"""Half the side of what a point takes."""
PIXELS_OF_A_GAP, BETWEEN_PIXELS = 1.0, 3.0
DIRECTIONS = ((0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1))


@dataclass(frozen=True)
class PointLabel:
    """``text`` for the point (x, y) of ``axis``, in data coordinates."""

    axis: Axes
    x: float
    y: float
    text: str
    colour: str


def label_points(figure: Figure, labels: Iterable[PointLabel]) -> list[Annotation]:
    """Write each label as near to its point as there is room; those that have none are left out.

    All else must be drawn before: places are found in pixels of the figure as it stands.  Returns
    what was written.
    """
    figure.draw_without_rendering()
    written: list[Annotation] = []
    figure.set_layout_engine("none")  # what was laid out stays
    of_axis: dict[Axes, list[PointLabel]] = {}
    for label in labels:
        of_axis.setdefault(label.axis, []).append(label)
    for axis, some in of_axis.items():
        taken, curves = _taken(axis), _on_curves(axis)
        for label in some:
            note = _placed(axis, label, taken, curves)
            if note is not None:
                written.append(note)
                taken.append(note.get_window_extent())
    return written


def _taken(axis: Axes) -> list[Bbox]:
    """Boxes of the points of all curves, of texts, and of the legend."""
    half = MARKER_PT * axis.figure.dpi / 72
    boxes = []
    for line in axis.lines:
        if line.get_marker() in (None, "None", "", " "):
            continue
        for x, y in line.get_transform().transform(np.asarray(line.get_xydata(), float)):
            if np.isfinite([x, y]).all():
                boxes.append(Bbox([[x - half, y - half], [x + half, y + half]]))
    boxes += [text.get_window_extent() for text in axis.texts if text.get_text()]
    if (legend := axis.get_legend()) is not None:
        boxes.append(legend.get_window_extent())
    return boxes


def _on_curves(axis: Axes) -> np.ndarray:
    """(K, 2) points along all curves and bars, in pixels, a few pixels apart."""
    chains = [
        line.get_transform().transform(np.asarray(line.get_xydata(), float))
        for line in axis.lines
        if line.get_linestyle() not in ("None", "", " ")
    ]
    for bars in axis.collections:  # of quartiles
        if isinstance(bars, LineCollection):
            parts = (np.reshape(part, (-1, 2)) for part in bars.get_segments() if len(part))
            chains += [axis.transData.transform(part) for part in parts]
    found = [np.empty((0, 2))]
    for points in chains:
        points = points[np.isfinite(points).all(axis=1)]
        for start, end in itertools.pairwise(points):
            steps = 2 + int(np.hypot(*(end - start)) / BETWEEN_PIXELS)
            found.append(np.linspace(start, end, steps))
    return np.concatenate(found)


def _placed(
    axis: Axes, label: PointLabel, taken: list[Bbox], curves: np.ndarray
) -> Annotation | None:
    """The label at the first free place around its point, nearest first; where curves pass all of
    them, on a curve."""
    room = axis.get_window_extent()
    note = axis.annotate(
        label.text, (label.x, label.y), xytext=(0, 0), textcoords="offset points",
        size=SIZE_PT, color=label.colour, ha="center", va="center",
    )  # fmt: skip
    at = note.get_window_extent()
    scale = axis.figure.dpi / 72
    second: np.ndarray | None = None
    for distance in DISTANCES_PT:
        for right, up in DIRECTIONS:
            # The label's edge, and not its middle, is so far from the point.
            half = np.array([at.width, at.height]) / 2 / scale
            move = np.array([right, up]) * (distance + half)
            box = at.translated(*(move * scale)).padded(PIXELS_OF_A_GAP)
            inside = room.x0 <= box.x0 and box.x1 <= room.x1
            inside &= room.y0 <= box.y0 and box.y1 <= room.y1
            if not inside or any(box.overlaps(other) for other in taken):
                continue
            if not ((curves > box.min) & (curves < box.max)).all(axis=1).any():
                note.set_position(tuple(move))
                return note
            second = move if second is None else second
    if second is None:
        note.remove()
        return None
    note.set_position(tuple(second))
    return note
