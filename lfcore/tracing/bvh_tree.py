"""The tree as arrays, and what must hold for them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lfcore.errors import SceneError
from lfcore.tracing.bvh_wide import UNUSED

ROWS = {"boxes": (6, 16), "children": (16,), "leaves": (9, 16), "leaf_ids": (16,)}
ROWS["leaf_boxes"] = (6,)
MIXING = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
"""Odd numbers that make one of three."""


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
