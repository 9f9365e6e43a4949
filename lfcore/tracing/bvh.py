"""Bounding volume hierarchy of 16-wide nodes over triangles in camera space.

All rays of a light field look along +z and come in bundles, so a bundle meets a node with one
pass over 16 boxes and a leaf with one pass over 16 triangles; children lie front to back.

Building is a binned surface area heuristic, 256 bins in each of three dimensions over the
centroid bounds, breadth-first; nodes of at most 256 triangles take the exact sweep over their
sorted centroids, which is the limit of infinitely many bins and, for so few, cheaper than
filling them.  A leaf of up to 16 triangles is one SIMD test, so the heuristic charges a part of
n triangles ceil(n / 16) tests.  See ``bvh_split`` (cuts), ``bvh_binary`` (the binary
tree), ``bvh_wide`` (the collapse to 16 children) and ``bvh_tree`` (the result, and what
must hold for it).
"""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.errors import SceneError
from lfcore.files import read_arrays, whole_file
from lfcore.tracing.bvh_binary import build_binary
from lfcore.tracing.bvh_split import LEAF_SIZE
from lfcore.tracing.bvh_tree import Bvh, in_one_order, shape_problem
from lfcore.tracing.bvh_wide import LARGEST, UNUSED, WIDTH, collapse


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
    used = ids >= 0
    corners = np.zeros((len(ids), LEAF_SIZE, 9), np.float32)
    corners[used] = in_one_order(triangles).reshape(-1, 9)[ids[used]]
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
    # NaN compares false, so it is caught by the same test.
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
    """Read what :func:`save_bvh` wrote.

    Raises
    ------
    SceneError
        if the file is missing, damaged or holds something else.
    """

    def read(data: Any) -> Bvh:
        bvh = Bvh(**{f.name: data[f.name] for f in fields(Bvh)})
        if problem := shape_problem(bvh):
            raise ValueError(problem)
        return bvh

    return read_arrays(path, "BVH", read, kind=SceneError)
