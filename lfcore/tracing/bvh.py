"""Bounding volume hierarchy of 16-wide nodes over triangles in camera space.

All rays of a light field look along +z, in bundles.  A bundle tests a node by one pass over 16
boxes and a leaf by one pass over 16 triangles; children are ordered front to back.

Building is a binned surface area heuristic, 256 bins in each of three dimensions over the
centroid bounds, breadth-first; nodes of at most 256 triangles take the exact sweep over their
sorted centroids, which is the limit of infinitely many bins and, for so few, cheaper than
filling them.  A leaf of up to 16 triangles is one SIMD test, so the heuristic charges a part of
n triangles ceil(n / 16) tests.  See ``bvh_split`` (cuts), ``bvh_binary`` (the binary
tree) and ``bvh_wide`` (the collapse to 16 children).
"""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.errors import SceneError
from lfcore.files import read_arrays, whole_file
from lfcore.tracing.bvh_binary import build_binary
from lfcore.tracing.bvh_split import LEAF_SIZE
from lfcore.tracing.bvh_wide import LARGEST, UNUSED, WIDTH, collapse

ROWS = {"boxes": (6, 16), "children": (16,), "leaves": (9, 16), "leaf_ids": (16,)}
ROWS["leaf_boxes"] = (6,)
MIXING = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], np.uint64)
"""Odd multipliers that hash three numbers into one."""


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
        triangles, of :func:`in_one_order`; padding is all zero, a triangle without hits.
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


def build_bvh(triangles: np.ndarray) -> Bvh:
    """Build a tree; equal input gives an equal tree, bit by bit.

    Parameters
    ----------
    triangles : (T, 3, 3) float32, T >= 0, camera space.  Degenerate and duplicate triangles
        are kept: they cost little and the caller's numbers stay valid.

    Raises
    ------
    SceneError
        for another shape, or a coordinate that is not finite or not below 1e30 in size.
    """
    triangles = _checked(triangles)
    if not len(triangles):
        return _empty()
    tree = build_binary(triangles)
    wide = collapse(tree)
    # The triangles of each leaf, ascending, and -1 for padding.
    lane, start, count = np.arange(LEAF_SIZE), tree.start[wide.leaves], tree.count[wide.leaves]
    position = np.minimum(start[:, None] + lane, len(tree.order) - 1)
    ids = np.sort(np.where(lane < count[:, None], tree.order[position], np.int32(UNUSED)), axis=1)
    ids[ids == UNUSED] = -1
    is_triangle = ids >= 0
    corners = np.zeros((len(ids), LEAF_SIZE, 9), np.float32)
    corners[is_triangle] = in_one_order(triangles).reshape(-1, 9)[ids[is_triangle]]
    return Bvh(
        boxes=wide.boxes,
        children=wide.children,
        leaves=np.ascontiguousarray(corners.transpose(0, 2, 1)),
        leaf_ids=ids,
        leaf_boxes=np.concatenate([tree.lo[wide.leaves], tree.hi[wide.leaves]], axis=1),
    )


def _checked(triangles: np.ndarray) -> np.ndarray:
    triangles = np.ascontiguousarray(triangles, np.float32)
    if triangles.ndim != 3 or triangles.shape[1:] != (3, 3):
        raise SceneError(f"triangles must be of shape (T, 3, 3), not {triangles.shape}")
    # NaN compares false, so the same test rejects it.
    bad = np.flatnonzero(~(np.abs(triangles).max(axis=(1, 2), initial=0) < LARGEST))
    if len(bad):
        raise SceneError(
            f"{len(bad)} triangles have coordinates that are not finite or beyond {LARGEST:g}, "
            f"the first is number {bad[0]}",
            remedy="Leave them out, or scale the scene down",
        )
    return triangles


def _empty() -> Bvh:
    """One node whose children are all unused."""
    boxes = np.empty((1, 6, WIDTH), np.float32)
    boxes[:, :3], boxes[:, 3:] = LARGEST, -LARGEST
    return Bvh(
        boxes,
        np.full((1, WIDTH), UNUSED, np.int32),
        np.zeros((0, 9, LEAF_SIZE), np.float32),
        np.zeros((0, LEAF_SIZE), np.int32),
        np.zeros((0, 6), np.float32),
    )


def save_bvh(path: str | Path, bvh: Bvh) -> None:
    """Write ``bvh`` to ``path`` (.npz), whole or not at all."""
    with whole_file(path) as file:
        np.savez(file, **{f.name: getattr(bvh, f.name) for f in fields(Bvh)})


def load_bvh(path: str | Path) -> Bvh:
    """Read a file of :func:`save_bvh`.

    Raises
    ------
    SceneError
        The file is missing, damaged or of another kind.
    """

    def read(data: Any) -> Bvh:
        bvh = Bvh(**{f.name: data[f.name] for f in fields(Bvh)})
        if problem := shape_problem(bvh):
            raise ValueError(problem)
        return bvh

    return read_arrays(path, "BVH", read, kind=SceneError)


def shape_problem(bvh: Bvh) -> str | None:
    """The first error in shapes, dtypes and references; None without errors."""
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
    """Give copies of a triangle, rewound or flipped, the corner order of the first: (T, 3, 3)
    float32.

    Depths of copies are then equal to the last bit in every kernel, and the lowest number wins.
    """
    # A number per triangle, independent of the order of corners.
    bits = (triangles + 0.0).view(np.uint32)
    keys = (bits[:, 0].astype(np.uint64) + bits[:, 1] + bits[:, 2]) @ MIXING
    ordered = np.sort(keys)
    repeated = ordered[1:][ordered[1:] == ordered[:-1]]
    if not len(repeated):
        return triangles
    candidates = np.flatnonzero(np.isin(keys, repeated))
    corners = np.unique(triangles[candidates].reshape(-1, 3), axis=0, return_inverse=True)[1]
    corners = np.sort(corners.reshape(-1, 3), axis=1)
    _, first, copy_of = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    triangles = triangles.copy()
    triangles[candidates] = triangles[candidates[first[copy_of.ravel()]]]
    return triangles


def depths(bvh: Bvh) -> list[np.ndarray]:
    """Wide nodes by level, from the root on."""
    levels: list[np.ndarray] = []
    nodes = np.array([0])
    while len(nodes):
        if sum(map(len, levels)) > len(bvh.children):
            raise SceneError("the nodes of the BVH form a cycle")
        levels.append(nodes)
        child = bvh.children[nodes]
        nodes = child[(child >= 0) & (child != UNUSED)]
    return levels
