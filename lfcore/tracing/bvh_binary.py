"""The binary tree that the wide tree is made from: top-down SAH, one level at a time.

All nodes of a level are cut together, so that the cost per level is a handful of passes of
numpy over the triangles and not a Python step per node.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from lfcore.tracing.bvh_split import LEAF_SIZE, Cuts, Sorted, best_cuts, ranges

NODE_COST = 0.25
"""The cost of a binary node, in leaf tests, when a leaf is cut further.  The collapse joins leaves
that do not pay, so this only bounds its choices: 0 gains 2% of SAH cost over 0.25 and needs 1.5
times the leaves; 0.5 loses 1%."""
SAH_DEPTH = 64
"""The depth below which nodes are cut by count, so that no geometry makes a chain of nodes."""


@dataclass(frozen=True)
class BinaryTree:
    """Nodes in breadth-first order, the root is 0.

    ``left`` (n,) int64: index of the left child, the right one follows it; -1 for a leaf.
    ``start``, ``count`` (n,) int64: the node's range of ``order``.
    ``levels``: the first node of each level, and the number of nodes.
    ``order`` (T,) int32: triangles; ``lo``, ``hi`` (n, 3) float32: exact bounds.
    """

    left: np.ndarray
    start: np.ndarray
    count: np.ndarray
    levels: list[int]
    order: np.ndarray
    lo: np.ndarray
    hi: np.ndarray


def build_binary(triangles: np.ndarray) -> BinaryTree:
    """SAH tree over ``triangles`` (T, 3, 3) float32, finite, T >= 1."""
    total = len(triangles)
    boxes, centroids, identity = _prepare(triangles)
    order = np.stack([np.argsort(centroids[axis], kind="stable") for axis in range(3)])
    sorted_triangles, goes_right = Sorted(boxes, centroids, order), np.zeros(total, np.int32)

    start, count = np.array([0]), np.array([total])
    lefts: list[np.ndarray] = []
    starts, counts, levels = [start], [count], [0, 1]
    while len(start):
        cut, axis, k = _decide(sorted_triangles, start, count, len(lefts))
        left = np.full(len(start), -1)
        left[cut] = levels[-1] + 2 * np.arange(len(cut))
        lefts.append(left)
        start, count = start[cut], count[cut]
        _partition(order, goes_right, start, count, axis, k)
        start = np.stack([start, start + k], 1).ravel()
        count = np.stack([k, count - k], 1).ravel()
        if len(start):
            starts.append(start)
            counts.append(count)
            levels.append(levels[-1] + len(start))
    left, start, count = (np.concatenate(parts) for parts in (lefts, starts, counts))
    lo, hi = _bounds(boxes, order[0], left, start, levels)
    return BinaryTree(left, start, count, levels, identity[order[0]], lo, hi)


def _prepare(triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Boxes (6, T + 1) with negated hi, centroids (3, T), and the triangles' numbers.

    Triangles are put in Morton order first, so that the triangles of a small node are
    neighbours in memory, whatever the file's order.
    """
    p, q, r = np.ascontiguousarray(triangles.transpose(1, 2, 0))
    lo, hi = np.minimum(np.minimum(p, q), r), np.maximum(np.maximum(p, q), r)
    centroids = lo * np.float32(0.5) + hi * np.float32(0.5)
    identity = np.argsort(_morton(centroids), kind="stable").astype(np.int32)
    boxes = np.full((6, len(triangles) + 1), np.inf, np.float32)
    boxes[:3, :-1] = lo[:, identity]
    np.negative(hi[:, identity], out=boxes[3:, :-1])
    return boxes, np.ascontiguousarray(centroids[:, identity]), identity


def _morton(centroids: np.ndarray) -> np.ndarray:
    """Morton codes of 16 bits a coordinate, (T,) int64, of centroids (3, T)."""
    code = np.zeros(centroids.shape[1], np.int64)
    for axis, values in enumerate(centroids.astype(np.float64)):
        extent = np.ptp(values)
        cell = ((values - values.min()) / extent * 65535 if extent > 0 else values * 0).astype(
            np.int64
        )
        for shift, mask in ((16, 0x0000FF0000FF), (8, 0x00F00F00F00F), (4, 0x0C30C30C30C3)):
            cell = (cell | cell << shift) & mask
        cell = (cell | cell << 2) & 0x249249249249
        code |= cell << axis
    return code


def _decide(
    triangles: Sorted, start: np.ndarray, count: np.ndarray, depth: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The indices of the nodes to cut, with axis and k of their cuts; other nodes become leaves."""
    several = np.flatnonzero(count > 1)
    start, count = start[several], count[several]
    if depth < SAH_DEPTH:
        cuts = best_cuts(triangles, start, count)
    else:
        cuts = Cuts.empty(len(several))
    # If all centroids are equal, the node is a point or a segment along an axis, or the tree is
    # too deep, areas do not help: halve the count, in whole leaves.
    blind = ~np.isfinite(cuts.cost) | (cuts.area == 0)
    halves = LEAF_SIZE * -(-count // (2 * LEAF_SIZE))
    axis = np.where(blind, _widest(triangles, start, count), cuts.axis)
    k = np.where(blind, halves, cuts.k)
    worthwhile = ~blind & (cuts.cost + NODE_COST * cuts.area < cuts.area)
    cut = (count > LEAF_SIZE) | worthwhile
    return several[cut], axis[cut], k[cut]


def _widest(triangles: Sorted, start: np.ndarray, count: np.ndarray) -> np.ndarray:
    """The axis along which each node's centroids extend farthest; they are sorted."""
    centroids, order = triangles.centroids, triangles.order
    low = [centroids[a][order[a][start]].astype(np.float64) for a in range(3)]
    high = [centroids[a][order[a][start + count - 1]].astype(np.float64) for a in range(3)]
    return np.argmax(np.subtract(high, low), axis=0)


def _partition(
    order: np.ndarray,
    goes_right: np.ndarray,
    start: np.ndarray,
    count: np.ndarray,
    axis: np.ndarray,
    k: np.ndarray,
) -> None:
    """Move the first ``k`` of ``order[axis]`` of each node to its front in all three orders.

    Stable, so that both halves stay sorted.  ``goes_right`` is scratch, one entry per triangle.
    """
    total = order.shape[1]
    edges = np.r_[0, np.flatnonzero(np.diff(np.cumsum(count) >> 18)) + 1, len(count)]
    for first, last in pairwise(edges):
        part = slice(first, last)
        size = count[part]
        position = ranges(start[part], size)
        if not len(position):
            continue
        begin = np.cumsum(size) - size
        rank = np.arange(len(position)) - np.repeat(begin, size)
        left_size = np.repeat(k[part], size)
        chosen = order.ravel()[position + np.repeat(axis[part] * total, size)]
        goes_right[chosen] = rank >= left_size
        for a in range(3):
            triangle = order[a][position]
            right = goes_right[triangle]
            rights = np.cumsum(right)
            rights -= right
            rights -= np.repeat(rights[begin], size)
            shift = np.where(right, left_size + rights - rank, -rights)
            order[a][position + shift] = triangle


def _bounds(
    boxes: np.ndarray, order: np.ndarray, left: np.ndarray, start: np.ndarray, levels: list[int]
) -> tuple[np.ndarray, np.ndarray]:
    """Exact float32 bounds of all nodes, leaves first and then upwards."""
    leaves = np.flatnonzero(left < 0)
    leaves = leaves[np.argsort(start[leaves])]  # they tile the order
    table = np.empty((6, len(left)), np.float32)
    for k in range(6):
        table[k, leaves] = np.minimum.reduceat(boxes[k][order], start[leaves])
    for first, last in zip(levels[-2::-1], levels[:0:-1], strict=True):
        inner = first + np.flatnonzero(left[first:last] >= 0)
        child = left[inner]
        table[:, inner] = np.minimum(table[:, child], table[:, child + 1])
    return table[:3].T.copy(), np.negative(table[3:]).T.copy()
