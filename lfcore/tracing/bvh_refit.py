"""Trees of triangles that move: the old tree with new boxes, while that is nearly as good."""

from dataclasses import replace

import numpy as np

from lfcore.tracing.bvh import Bvh, build_bvh, depths, in_one_order
from lfcore.tracing.bvh_wide import LARGEST, UNUSED

MOST_COST = 1.3
"""The cost of a tree with new boxes, relative to a built one, from which a tree is built anew."""


class MovingTree:
    """The tree of triangles that move, one instant after another."""

    def __init__(self) -> None:
        self._tree: Bvh | None = None
        self._cost = 0.0
        self.built = 0  # how often

    def at(self, triangles: np.ndarray) -> Bvh:
        """The tree of triangles (T, 3, 3); raises as :func:`build_bvh`."""
        if self._tree is not None and (self._tree.leaf_ids >= 0).sum() == len(triangles):
            tree = refit(self._tree, triangles)
            if _cost(tree, triangles) <= MOST_COST * self._cost:
                return tree
        self._tree, self.built = build_bvh(triangles), self.built + 1
        self._cost = _cost(self._tree, triangles)
        return self._tree


def refit(bvh: Bvh, triangles: np.ndarray) -> Bvh:
    """The tree with as many triangles (T, 3, 3) float32 in new places."""
    is_triangle = bvh.leaf_ids >= 0
    corners = in_one_order(np.ascontiguousarray(triangles, np.float32))[bvh.leaf_ids]
    points = np.where(is_triangle[..., None, None], corners, np.float32(np.nan))
    low, high = np.nanmin(points, axis=(1, 2)), np.nanmax(points, axis=(1, 2))
    leaf_boxes = np.concatenate([low, high], axis=1)
    rows = np.where(is_triangle[..., None, None], corners, 0).reshape(*is_triangle.shape, 9)
    leaves = np.ascontiguousarray(rows.swapaxes(1, 2))
    boxes, children = bvh.boxes.copy(), bvh.children.copy()
    own = np.empty((len(boxes), 6), np.float32)
    unused = np.array([LARGEST] * 3 + [-LARGEST] * 3, np.float32)
    for level in reversed(depths(bvh)):
        child = children[level]
        around = np.where(
            (child == UNUSED)[..., None], unused, own[np.clip(child, 0, len(own) - 1)]
        )
        is_leaf = child < 0
        around[is_leaf] = leaf_boxes[-1 - child[is_leaf]]
        order = np.argsort(np.where(child == UNUSED, np.inf, around[..., 2]), axis=1, kind="stable")
        children[level] = np.take_along_axis(child, order, axis=1)
        around = np.take_along_axis(around, order[..., None], axis=1)
        boxes[level] = around.swapaxes(1, 2)
        own[level] = np.concatenate([around[..., :3].min(1), around[..., 3:].max(1)], axis=1)
    return replace(bvh, boxes=boxes, children=children, leaves=leaves, leaf_boxes=leaf_boxes)


def _cost(bvh: Bvh, triangles: np.ndarray) -> float:
    """The surface of all boxes, relative to that of the triangles' own."""
    inner = bvh.boxes.swapaxes(1, 2)[bvh.children != UNUSED]
    low, high = triangles.min(1), triangles.max(1)
    return _surface(inner) / (_surface(np.concatenate([low, high], axis=1)) or 1.0)


def _surface(boxes: np.ndarray) -> float:
    x, y, z = (boxes[:, 3:].astype(np.float64) - boxes[:, :3]).T
    return float((x * y + y * z + z * x).sum())
