"""Collapse of the binary tree into nodes of 16 children, at the least expected cost.

For each binary node and each number of slots j, ``C(n, j)`` is the least cost of representing
the subtree of n by at most j children of some wide node:

    D(n, j) = min over k of C(left, k) + C(right, j - k)
    C(n, 1) = min(leaf test if n fits a leaf, node test + D(n, 16))
    C(n, j) = min(D(n, j), C(n, j - 1))

Each test is weighted by the half area of its box.  Costs are computed upwards, a level at a time,
and choices are read downwards.  Opening the child of the largest surface until there are 16 is
simpler, but leaves nodes a third full: 1.1 times the expected tests in mixed scenes, and twice the
nodes.

Source: H. Ylitie, T. Karras, S. Laine, "Efficient incoherent ray traversal on GPUs through
compressed wide BVHs", 2017, section 3.1.
"""

from dataclasses import dataclass

import numpy as np

from lfcore.tracing.bvh_binary import BinaryTree
from lfcore.tracing.bvh_split import LEAF_SIZE

WIDTH = 16
UNUSED = 0x7FFFFFFF
LARGEST = np.float32(1e30)
"""The bound of coordinates; the box of an unused child goes from it to its negative."""
CHUNK = 1 << 13
"""The nodes whose costs are computed together: 1 MB per table."""


@dataclass(frozen=True)
class WideTree:
    """``boxes`` (K, 6, 16) float32 and ``children`` (K, 16) int32 as in ``Bvh``; ``leaves``
    (L,) int64: the binary node whose triangles wide leaf l holds."""

    boxes: np.ndarray
    children: np.ndarray
    leaves: np.ndarray


def collapse(tree: BinaryTree) -> WideTree:
    """The wide tree, its nodes and its leaves in breadth-first order."""
    as_leaf, left_slots, used_slots = _choices(tree)
    boxes, children, leaves = [], [], []
    nodes, leaf_count = 1, 0
    # The root is a wide node even over a single leaf.
    root = np.array([[0] + [-1] * (WIDTH - 1)])
    slots = root if as_leaf[0] else _distribute(tree, left_slots, used_slots, np.array([0]))
    while len(slots):
        # By lo.z ascending, unused last, ties as they were.
        depth = np.where(slots >= 0, tree.lo[slots, 2], np.inf)
        slots = np.take_along_axis(slots, np.argsort(depth, axis=1, kind="stable"), axis=1)
        is_used = slots >= 0
        is_leaf = is_used & as_leaf[slots]
        is_inner = is_used & ~is_leaf
        child = np.full(slots.shape, UNUSED, np.int32)
        new_leaves, inner = slots[is_leaf], slots[is_inner]
        child[is_leaf] = -1 - (leaf_count + np.arange(len(new_leaves)))
        child[is_inner] = nodes + np.arange(len(inner))
        leaf_count += len(new_leaves)
        nodes += len(inner)
        children.append(child)
        leaves.append(new_leaves)
        low, high = tree.lo[slots].transpose(0, 2, 1), tree.hi[slots].transpose(0, 2, 1)
        is_used = is_used[:, None, :]
        box = np.where(is_used, low, LARGEST), np.where(is_used, high, -LARGEST)
        boxes.append(np.ascontiguousarray(np.concatenate(box, axis=1)))
        slots = _distribute(tree, left_slots, used_slots, inner)
    return WideTree(np.concatenate(boxes), np.concatenate(children), np.concatenate(leaves))


def _half_areas(tree: BinaryTree) -> np.ndarray:
    extent = tree.hi.astype(np.float64) - tree.lo
    return extent[:, 0] * extent[:, 1] + (extent[:, 0] + extent[:, 1]) * extent[:, 2]


def _choices(tree: BinaryTree) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The optimal choices at each node.

    Returns ``as_leaf`` (n,): with one slot, a leaf and not a wide node; ``left_slots``
    (n, 17) uint8: the left child's share of j slots; ``used_slots`` (n, 17) uint8: the used ones
    of j slots.
    """
    total = len(tree.left)
    area = _half_areas(tree)
    as_leaf = np.zeros(total, bool)
    left_slots = np.zeros((total, WIDTH + 1), np.uint8)
    used_slots = np.ones((total, WIDTH + 1), np.uint8)
    below, below_first = np.zeros((WIDTH + 1, 0)), total
    for first, last in zip(tree.levels[-2::-1], tree.levels[:0:-1], strict=True):
        level = np.empty((WIDTH + 1, last - first))
        for start in range(first, last, CHUNK):
            part = slice(start, min(start + CHUNK, last))
            columns = slice(part.start - first, part.stop - first)
            level[:, columns] = _least_costs(
                tree.left[part] - below_first,
                below,
                area[part],
                np.where(tree.count[part] <= LEAF_SIZE, area[part], np.inf),
                left_slots[part],
                used_slots[part],
                as_leaf[part],
            )
        below, below_first = level, first
    return as_leaf, left_slots, used_slots


def _least_costs(
    left: np.ndarray,
    below: np.ndarray,
    area: np.ndarray,
    leaf: np.ndarray,
    left_slots: np.ndarray,
    used_slots: np.ndarray,
    as_leaf: np.ndarray,
) -> np.ndarray:
    """(17, m) costs C(n, j), row j, of m nodes whose children's costs are ``below``.

    ``left`` indexes ``below``, negative for nodes without children.  The choices are written
    into the views ``left_slots``, ``used_slots`` and ``as_leaf``.
    """
    inner = left >= 0
    costs = np.tile(leaf, (WIDTH + 1, 1))
    as_leaf[:] = True
    if not inner.any():
        return costs
    left_costs, right_costs = below[:, left[inner]], below[:, left[inner] + 1]
    best = np.full((WIDTH + 1, left_costs.shape[1]), np.inf)
    choice = np.zeros((WIDTH + 1, left_costs.shape[1]), np.uint8)
    for slots in range(2, WIDTH + 1):
        for k in range(1, slots):
            sum_ = left_costs[k] + right_costs[slots - k]
            better = sum_ < best[slots]
            np.copyto(best[slots], sum_, where=better)
            np.copyto(choice[slots], np.uint8(k), where=better)
    left_slots[inner] = choice.T
    node = area[inner] + best[WIDTH]
    as_leaf[inner] = leaf[inner] <= node
    best[1] = np.minimum(leaf[inner], node)
    use = np.ones_like(choice)
    for slots in range(2, WIDTH + 1):
        split = best[slots] < best[slots - 1]
        use[slots] = np.where(split, slots, use[slots - 1])
        best[slots] = np.minimum(best[slots], best[slots - 1])
    used_slots[inner] = use.T
    costs[:, inner] = best
    return costs


def _distribute(
    tree: BinaryTree, left_slots: np.ndarray, used_slots: np.ndarray, roots: np.ndarray
) -> np.ndarray:
    """(W, 16) binary nodes that become the children of wide nodes ``roots``; -1 unused."""
    slots = np.full((len(roots), WIDTH), -1)
    filled = np.zeros(len(roots), np.int64)
    row, node = np.arange(len(roots)), roots
    budget = np.full(len(roots), WIDTH)
    while len(row):
        share = left_slots[node, budget].astype(np.int64)
        left = tree.left[node]
        row = np.concatenate([row, row])
        node = np.concatenate([left, left + 1])
        budget = np.concatenate([share, budget - share])
        budget = used_slots[node, budget].astype(np.int64)
        single = np.flatnonzero(budget == 1)
        single = single[np.argsort(row[single], kind="stable")]
        ready = row[single]
        begin = np.flatnonzero(np.diff(ready, prepend=-1))
        size = np.diff(begin, append=len(ready))
        rank = np.arange(len(ready)) - np.repeat(begin, size)
        slots[ready, filled[ready] + rank] = node[single]
        filled[ready[begin]] += size
        more = budget > 1
        row, node, budget = row[more], node[more], budget[more]
    return slots
