"""The tree as arrays, what must hold for them, and figures about it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lfcore.errors import SceneError
from lfcore.tracing.bvh_wide import LARGEST, UNUSED

ROWS = {"boxes": (6, 16), "children": (16,), "leaves": (9, 16), "leaf_ids": (16,)}
ROWS["leaf_boxes"] = (6,)
MIXING = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
"""Odd numbers that make one of three."""


@dataclass(frozen=True)
class Statistics:
    """Figures of a tree.

    ``depth`` : wide nodes on the longest path from the root to a leaf.
    ``node_cost``, ``leaf_cost`` : expected 16-wide tests of nodes and leaves by a random line
        through the root's box, by surface areas.
    """

    triangles: int
    nodes: int
    leaves: int
    depth: int
    node_cost: float
    leaf_cost: float


@dataclass(frozen=True)
class Bvh:
    """A flat wide tree; the root is node 0.

    Attributes
    ----------
    boxes : (K, 6, 16) float32: rows lo.x lo.y lo.z hi.x hi.y hi.z of the 16 children of wide
        node k, exact bounds of the vertices, metres; an unused child has lo = 1e30, hi = -1e30.
    children : (K, 16) int32: a wide node if >= 0, leaf ``-1 - child`` if negative, 0x7fffffff
        if unused; by lo.z ascending, unused last.
    leaves : (L, 9, 16) float32: rows p.x p.y p.z q.x q.y q.z r.x r.y r.z of up to 16
        triangles, of :func:`in_one_order`; padding is all zero, a triangle that nothing can hit.
    leaf_ids : (L, 16) int32: the triangles' numbers, ascending; -1 for padding.
    leaf_boxes : (L, 6) float32: lo and hi of each leaf.
    """

    boxes: np.ndarray
    children: np.ndarray
    leaves: np.ndarray
    leaf_ids: np.ndarray
    leaf_boxes: np.ndarray

    @property
    def leaf_count(self) -> int:
        return len(self.leaf_ids)

    def check(self, triangles: np.ndarray) -> None:
        """Raise :class:`SceneError` unless this is a valid tree of ``triangles`` (T, 3, 3).

        Every triangle lies in exactly one leaf with its own vertices, boxes are exact bounds,
        children are sorted, and every node and leaf is reached once.
        """
        problem = shape_problem(self) or _leaf_problem(self, triangles) or _node_problem(self)
        if problem:
            raise SceneError(problem, remedy="Build the tree of this scene again")

    def statistics(self) -> Statistics:
        """Size, depth and SAH cost of this tree."""
        used = self.children != UNUSED
        boxes = self.boxes.transpose(0, 2, 1).astype(np.float64)
        extent = np.where(used[..., None], boxes[..., 3:] - boxes[..., :3], 0.0)
        area = extent[..., 0] * extent[..., 1] + (extent[..., 0] + extent[..., 1]) * extent[..., 2]
        root = boxes[0][used[0]]
        size = root[:, 3:].max(axis=0) - root[:, :3].min(axis=0) if len(root) else np.zeros(3)
        whole = size[0] * size[1] + (size[0] + size[1]) * size[2] or 1.0
        return Statistics(
            triangles=int((self.leaf_ids >= 0).sum()),
            nodes=len(self.children),
            leaves=self.leaf_count,
            depth=len(depths(self)),
            node_cost=1.0 + float(area[used & (self.children >= 0)].sum() / whole),
            leaf_cost=float(area[self.children < 0].sum() / whole),
        )


def shape_problem(bvh: Bvh) -> str | None:
    """What is wrong with shapes, dtypes and references; None if nothing."""
    for name, row in ROWS.items():
        array = getattr(bvh, name)
        dtype = np.int32 if name in ("children", "leaf_ids") else np.float32
        if array.dtype != dtype or array.shape[1:] != row:
            return f"{name} is {array.dtype} {array.shape}, not {np.dtype(dtype)} (.., {row})"
    if not (len(bvh.boxes) == len(bvh.children) >= 1):
        return f"{len(bvh.boxes)} boxes for {len(bvh.children)} nodes"
    if not (len(bvh.leaves) == len(bvh.leaf_ids) == len(bvh.leaf_boxes)):
        return "leaf arrays differ in length"
    inner = bvh.children[(bvh.children >= 0) & (bvh.children != UNUSED)]
    leaf = -1 - bvh.children[bvh.children < 0]
    once = np.sort(inner), np.sort(leaf)
    if not np.array_equal(once[0], np.arange(1, len(bvh.children))):
        return "not every wide node is the child of exactly one other"
    if not np.array_equal(once[1], np.arange(len(bvh.leaf_ids))):
        return "not every leaf is the child of exactly one node"
    return None


def in_one_order(triangles: np.ndarray) -> np.ndarray:
    """(T, 3, 3) float32 with copies of a triangle, rewound or flipped, in the order of the first.

    Depths of copies are then equal to the last bit in every kernel, and the lowest number wins.
    """
    # A number for each triangle that does not depend on the order of corners.
    bits = (triangles + 0.0).view(np.uint32)
    keys = (bits[:, 0].astype(np.uint64) + bits[:, 1] + bits[:, 2]) @ MIXING
    ordered = np.sort(keys)
    repeated = ordered[1:][ordered[1:] == ordered[:-1]]
    if not len(repeated):
        return triangles
    some = np.flatnonzero(np.isin(keys, repeated))
    corners = np.unique(triangles[some].reshape(-1, 3), axis=0, return_inverse=True)[1]
    corners = np.sort(corners.reshape(-1, 3), axis=1)
    _, first, which = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    triangles = triangles.copy()
    triangles[some] = triangles[some[first[which.ravel()]]]
    return triangles


def depths(bvh: Bvh) -> list[np.ndarray]:
    """Wide nodes by level, from the root on."""
    levels: list[np.ndarray] = []
    nodes = np.array([0])
    while len(nodes):
        if sum(map(len, levels)) > len(bvh.children):
            raise SceneError("the nodes of the BVH form a circle")
        levels.append(nodes)
        child = bvh.children[nodes]
        nodes = child[(child >= 0) & (child != UNUSED)]
    return levels


def _leaf_problem(bvh: Bvh, triangles: np.ndarray) -> str | None:
    ids, used = bvh.leaf_ids, bvh.leaf_ids >= 0
    if not np.array_equal(np.sort(ids[used]), np.arange(len(triangles))):
        return "not every triangle lies in exactly one leaf"
    if not used[:, 0].all() or (used[:, 1:] & ~used[:, :-1]).any():
        return "a leaf is empty or has a gap"
    corners = bvh.leaves.transpose(0, 2, 1)
    if not np.array_equal(
        corners[used], in_one_order(triangles.astype(np.float32)).reshape(-1, 9)[ids[used]]
    ):
        return "a leaf holds other vertices than the triangles'"
    if corners[~used].any():
        return "padding of a leaf is not zero"
    points = corners.reshape(len(ids), 16, 3, 3)
    mask = used[:, :, None, None]
    lo = np.where(mask, points, np.inf).min(axis=(1, 2))
    hi = np.where(mask, points, -np.inf).max(axis=(1, 2))
    if not np.array_equal(bvh.leaf_boxes, np.concatenate([lo, hi], axis=1)):
        return "a leaf's box is not the bounds of its triangles"
    return None


def _node_problem(bvh: Bvh) -> str | None:
    child, boxes = bvh.children, bvh.boxes.transpose(0, 2, 1)
    unused = child == UNUSED
    if (unused[:, :-1] & ~unused[:, 1:]).any():
        return "an unused child precedes a used one"
    if not ((boxes[unused][:, :3] == LARGEST).all() and (boxes[unused][:, 3:] == -LARGEST).all()):
        return "an unused child has a box"
    if (np.diff(np.where(unused, LARGEST, boxes[:, :, 2]), axis=1) < 0).any():
        return "children are not sorted by lo.z"
    if unused[1:].all(axis=1).any():
        return "a node other than the root has no children"
    levels = depths(bvh)
    if sum(map(len, levels)) != len(child):
        return "a wide node cannot be reached"
    lo = np.where(unused[..., None], np.inf, boxes[..., :3]).min(axis=1)
    hi = np.where(unused[..., None], -np.inf, boxes[..., 3:]).max(axis=1)
    nodes = np.concatenate([lo, hi], axis=1)
    is_leaf, is_inner = child < 0, (child >= 0) & ~unused
    if not np.array_equal(boxes[is_leaf], bvh.leaf_boxes[-1 - child[is_leaf]]):
        return "a node's box of a leaf differs from the leaf's own"
    if not np.array_equal(boxes[is_inner], nodes[child[is_inner]]):
        return "a node's box is not the bounds of its children"
    return None
