"""Cuts of nodes by the surface area heuristic, for many nodes at once.

A node is a range ``[start, start + count)`` of positions.  ``order[axis]`` lists the triangles
so that each node's range holds its own triangles sorted by centroid along that axis.  Sorted
once at the root and kept so by stable partition, the centroids of a node never need sorting
again, every bin is a run of neighbouring positions, and every cut is a prefix of an order:
a pair ``(axis, k)``, the first ``k`` triangles going left.

Boxes are kept as rows ``lo.x lo.y lo.z -hi.x -hi.y -hi.z``, so that growing a box is one
minimum, and padded with +inf, which is empty.  Areas are float64: those of coordinates up to
1e30 overflow float32.

Source: I. Wald, "On fast construction of SAH-based bounding volume hierarchies", 2007
(binning); the sweep over sorted centroids is its limit of infinitely many bins.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

LEAF_SIZE = 16
"""The triangles per leaf test."""
BINS = 256
"""The bins per axis."""
CHUNK = 1 << 18
"""The entries of a padded table: long rows for numpy, in at most tens of MB."""
BALANCE = 1e-6
"""The relative cost of imbalance, which decides between cuts of equal cost: without it, identical
triangles would be cut into a chain."""


@dataclass(frozen=True)
class Sorted:
    """Triangles with their boxes and orders.

    ``boxes`` (6, T + 1) float32: lo and negated hi; column T is the empty box.
    ``centroids`` (3, T) float32; ``order`` (3, T) integers, see the module.
    """

    boxes: np.ndarray
    centroids: np.ndarray
    order: np.ndarray


@dataclass
class Cuts:
    """The best cut of each node: ``axis``, ``k``, ``cost`` and the half area of the node.

    ``cost`` is in units of leaf tests times half area, without the cost of the node itself;
    inf where no cut was found.
    """

    axis: np.ndarray
    k: np.ndarray
    cost: np.ndarray
    area: np.ndarray

    @classmethod
    def empty(cls, nodes: int) -> Cuts:
        return cls(
            np.zeros(nodes, np.int64),
            np.zeros(nodes, np.int64),
            np.full(nodes, np.inf),
            np.zeros(nodes),
        )

    def improve(self, rows: np.ndarray, axis: int, k: np.ndarray, cost: np.ndarray) -> None:
        """Take the cuts ``k`` of ``axis`` for the nodes ``rows`` where they are cheaper."""
        better = cost < self.cost[rows]
        rows = rows[better]
        self.axis[rows], self.k[rows], self.cost[rows] = axis, k[better], cost[better]


def best_cuts(triangles: Sorted, start: np.ndarray, count: np.ndarray) -> Cuts:
    """The cheapest cut of every node; ``start`` and ``count`` are (A,) int64, every count at
    least 2."""
    cuts = Cuts.empty(len(start))
    width = 2
    while width < BINS:
        low, width = width, width * 2
        chosen = np.flatnonzero((count >= (low if low == 2 else low + 1)) & (count <= width))
        for part in _chunks(chosen, max(1, CHUNK // width)):
            _sweep(cuts, part, triangles, start, count, width)
    chosen = np.flatnonzero(count > BINS)
    for part in _chunks_by_size(chosen, count[chosen]):
        _bin(cuts, part, triangles, start, count)
    return cuts


def _chunks(rows: np.ndarray, size: int) -> list[np.ndarray]:
    return [rows[first : first + size] for first in range(0, len(rows), size)]


def _chunks_by_size(rows: np.ndarray, sizes: np.ndarray) -> list[np.ndarray]:
    """Consecutive rows of about CHUNK triangles and at most CHUNK bins together."""
    if not len(rows):
        return []
    group = np.cumsum(np.maximum(sizes, BINS)) // CHUNK
    return np.split(rows, np.flatnonzero(np.diff(group)) + 1)


def _half_area(box: np.ndarray) -> np.ndarray:
    """Half surface area, float64, of boxes (6, ...) with negated hi; inf when empty."""
    x = np.add(box[0], box[3], dtype=np.float64)  # minus the extent: the signs cancel below
    y = np.add(box[1], box[4], dtype=np.float64)
    z = np.add(box[2], box[5], dtype=np.float64)
    area = x * y
    x += y
    x *= z
    area += x
    return area


def _scan_areas(table: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Half areas of all prefixes and suffixes of (W, 6, n) tables of boxes, along W.

    The scan runs over W and is vectorised over 6 n.  ``table`` is overwritten.
    """
    suffix = table.copy()
    for before, at in pairwise(table):
        np.minimum(before, at, out=at)
    for at, behind in zip(suffix[-2::-1], suffix[:0:-1], strict=True):
        np.minimum(at, behind, out=at)
    return _half_area(table.swapaxes(0, 1)), _half_area(suffix.swapaxes(0, 1))


def _cheapest(
    left: np.ndarray, right: np.ndarray, in_left: np.ndarray, count: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Row and cost of the cheapest of the cuts (W - 1, n); inf where none is valid."""
    in_right = count - in_left
    with np.errstate(invalid="ignore"):  # inf * 0 where a side is empty, masked below
        cost = left * -(-in_left // LEAF_SIZE)
        cost += right * -(-in_right // LEAF_SIZE)
        cost *= 1.0 + BALANCE * np.abs(in_right - in_left) / count
    cost[(in_left < 1) | (in_right < 1)] = np.inf
    row = np.argmin(cost, axis=0)
    return row, cost[row, np.arange(cost.shape[1])]


def _sweep(
    cuts: Cuts,
    rows: np.ndarray,
    triangles: Sorted,
    start: np.ndarray,
    count: np.ndarray,
    width: int,
) -> None:
    """Exact: every cut between neighbours in the three orders, nodes padded to ``width``."""
    boxes, order = triangles.boxes, triangles.order
    lane = np.arange(width)[:, None]
    sizes = count[rows]
    position = np.minimum(start[rows] + lane, order.shape[1] - 1)
    padding = lane >= sizes
    in_left = np.broadcast_to(np.arange(1, width)[:, None], (width - 1, len(rows)))
    table = np.empty((width, 6, len(rows)), np.float32)
    for axis in range(3):
        triangle = order[axis][position]
        triangle[padding] = boxes.shape[1] - 1
        for k in range(6):
            table[:, k] = boxes[k][triangle]
        prefix, suffix = _scan_areas(table)
        row, cost = _cheapest(prefix[:-1], suffix[1:], in_left, sizes)
        cuts.improve(rows, axis, row + 1, cost)
    cuts.area[rows] = prefix[-1]


def ranges(start: np.ndarray, count: np.ndarray) -> np.ndarray:
    """The concatenation of ``arange(start[i], start[i] + count[i])``."""
    ends = np.cumsum(count)
    return np.arange(ends[-1] if len(ends) else 0) + np.repeat(start - ends + count, count)


def _bin(
    cuts: Cuts, rows: np.ndarray, triangles: Sorted, start: np.ndarray, count: np.ndarray
) -> None:
    """256 bins over the centroid bounds of each axis."""
    boxes, order = triangles.boxes, triangles.order
    nodes, sizes = len(rows), count[rows]
    position = ranges(start[rows], sizes)
    first = np.cumsum(sizes) - sizes
    base = np.arange(nodes) * BINS
    for axis in range(3):
        triangle = order[axis][position]
        centroid = triangles.centroids[axis][triangle]
        low = centroid[first].astype(np.float64)
        extent = centroid[first + sizes - 1] - low
        scale = np.divide(BINS, extent, out=np.zeros(nodes), where=extent > 0)
        scaled = (centroid - np.repeat(low, sizes)) * np.repeat(scale, sizes)
        np.minimum(scaled, BINS - 1, out=scaled)
        bins = scaled.astype(np.int64)
        bins += np.repeat(base, sizes)
        runs = np.flatnonzero(np.diff(bins, prepend=-1))
        node, bin_ = np.divmod(bins[runs], BINS)
        table = np.full((BINS, 6, nodes), np.inf, np.float32)
        for k in range(6):
            table[bin_, k, node] = np.minimum.reduceat(boxes[k][triangle], runs)
        in_bin = np.zeros((BINS, nodes), np.int64)
        in_bin[bin_, node] = np.diff(runs, append=len(bins))
        prefix, suffix = _scan_areas(table)
        in_left = np.cumsum(in_bin, axis=0)[:-1]
        row, cost = _cheapest(prefix[:-1], suffix[1:], in_left, sizes)
        cuts.improve(rows, axis, in_left[row, np.arange(nodes)], cost)
    cuts.area[rows] = prefix[-1]
