"""The tree: its invariants on ordinary, degenerate and hostile input, and its files."""

import dataclasses

import numpy as np
import pytest
from plain_scenes import refused
from tracing_scenes import mesh

from lfcore.tracing import bvh_binary, bvh_split, bvh_wide
from lfcore.tracing.bvh import build_bvh, depths, in_one_order, load_bvh, save_bvh, shape_problem
from lfcore.tracing.bvh_refit import MovingTree, refit
from lfcore.tracing.bvh_wide import LARGEST, UNUSED

FIELDS = ("boxes", "children", "leaves", "leaf_ids", "leaf_boxes")


def soup(count, seed=0, size=0.05):
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1, 1, (count, 1, 3)) + rng.normal(0, size, (count, 3, 3))
    return corners.astype(np.float32)


def grid(n):
    """A plane of 2 n^2 triangles at z = 1: many equal centroid coordinates, flat boxes."""
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0))
    return mesh(np.stack([x, y, np.ones_like(x)], -1))


SIZES = np.linspace(0.1, 1, 600, dtype=np.float32)[:, None, None]
CASES = {
    "none": np.zeros((0, 3, 3), np.float32),
    "one": soup(1),
    "two": soup(2),
    "one full leaf": soup(16),
    "one more": soup(17),
    "at the sweep's limit": soup(256),
    "beyond the sweep": soup(257),
    "soup": soup(3000),
    "plane": grid(20),
    "identical": np.repeat(soup(1), 1000, axis=0),
    "same centroid": (soup(1) - soup(1).mean(1, keepdims=True)) * SIZES,
    "points": np.repeat(soup(700)[:, :1], 3, axis=1),
    "one point": np.zeros((900, 3, 3), np.float32),
    "on a line": soup(800) * np.float32([1, 0, 0]),
    "huge": soup(700) * np.float32(9e28),
    "tiny": soup(700) * np.float32(1e-38),
    "all sizes": (soup(2000) * np.logspace(-30, 25, 2000)[:, None, None]).astype(np.float32),
    "far off": soup(700) + np.float32(1e7),
}


def bounds(points, there):
    """(n, 6) of points (n, k, 3), as far as they are there."""
    low, high = (np.where(there[..., None], points, sign * np.inf) for sign in (1, -1))
    return np.concatenate([low.min(1), high.max(1)], 1)


def check(bvh, triangles):
    """Every triangle is in exactly one leaf with its own vertices, boxes are exact bounds, children
    are sorted, and every node and leaf is reached once."""
    assert shape_problem(bvh) is None
    ids, used, corners = bvh.leaf_ids, bvh.leaf_ids >= 0, bvh.leaves.transpose(0, 2, 1)
    np.testing.assert_array_equal(np.sort(ids[used]), np.arange(len(triangles)))
    assert used[:, 0].all() and (used[:, :-1] | ~used[:, 1:]).all()
    np.testing.assert_array_equal(corners[used], in_one_order(triangles).reshape(-1, 9)[ids[used]])
    assert not corners[~used].any()
    vertices = corners.reshape(len(ids), 48, 3)
    np.testing.assert_array_equal(bvh.leaf_boxes, bounds(vertices, np.repeat(used, 3, axis=1)))
    child, boxes, unused = bvh.children, bvh.boxes.transpose(0, 2, 1), bvh.children == UNUSED
    assert (~unused[:, :-1] | unused[:, 1:]).all()
    assert (boxes[unused] == np.repeat([LARGEST, -LARGEST], 3)).all()
    assert (np.diff(np.where(unused, LARGEST, boxes[:, :, 2]), axis=1) >= 0).all()
    assert (~unused[1:]).any(axis=1).all()
    assert sum(map(len, depths(bvh))) == len(child)
    is_leaf, is_inner = child < 0, (child >= 0) & ~unused
    nodes = bounds(boxes[:, :, :3], ~unused), bounds(boxes[:, :, 3:], ~unused)
    nodes = np.concatenate([nodes[0][:, :3], nodes[1][:, 3:]], 1)
    np.testing.assert_array_equal(boxes[is_leaf], bvh.leaf_boxes[-1 - child[is_leaf]])
    np.testing.assert_array_equal(boxes[is_inner], nodes[child[is_inner]])


@pytest.mark.parametrize("name", CASES)
def test_invariants(name):
    triangles = CASES[name]
    bvh = build_bvh(triangles)
    check(bvh, triangles)
    # Never a chain: SAH_DEPTH binary levels and then halves.
    assert len(depths(bvh)) <= bvh_binary.SAH_DEPTH + 12


@pytest.mark.parametrize("name", CASES)
def test_invariants_hold_when_triangles_move(name):
    moved = np.float32([1, -1, 1]) * CASES[name][::-1]
    check(refit(build_bvh(CASES[name]), moved), moved)


def test_a_tree_is_built_anew_once_its_boxes_overlap():
    ball, tree = soup(3000), MovingTree()
    check(tree.at(ball), ball)
    turned = (ball @ np.float32([[0.8, 0.6, 0], [-0.6, 0.8, 0], [0, 0, 1]])) * np.float32(3)
    check(tree.at(turned), turned)
    assert tree.built == 1
    mixed = np.random.default_rng(1).permutation(ball)
    check(tree.at(mixed), mixed)
    check(tree.at(ball[:-1]), ball[:-1])
    assert tree.built == 3


def half_area(points):
    extent = np.ptp(points.reshape(-1, 3).astype(np.float64), axis=0)
    return extent[0] * extent[1] + extent[1] * extent[2] + extent[2] * extent[0]


def cost(triangles, chosen):
    sides = triangles[chosen], triangles[~chosen]
    return sum(half_area(side) * -(-len(side) // 16) for side in sides)


def root_cut(triangles):
    """(cost, the triangles that go left) of the cut that the builder takes at the root."""
    boxes, centroids, identity = bvh_binary._prepare(triangles)
    order = np.stack([np.argsort(c, kind="stable") for c in centroids]).astype(np.int32)
    ordered = bvh_split.Sorted(boxes, centroids, order)
    cuts = bvh_split.best_cuts(ordered, np.array([0]), np.array([len(triangles)]))
    left = np.zeros(len(triangles), bool)
    left[identity[order[cuts.axis[0], : cuts.k[0]]]] = True
    np.testing.assert_allclose(cuts.area[0], half_area(triangles), rtol=1e-12)
    return cuts.cost[0], left


@pytest.mark.parametrize("count", [2, 3, 17, 40, 128, 255, 257, 1000])
def test_a_cut_is_the_cheapest_of_all_or_of_255_planes_an_axis(count):
    """Small nodes are swept, large ones are binned."""
    triangles = soup(count, seed=count, size=0.2)
    found, left = root_cut(triangles)
    place = (triangles.min(1) * np.float32(0.5) + triangles.max(1) * np.float32(0.5)).astype(float)
    if count > 256:
        place = np.minimum((place - place.min(0)) * (256 / np.ptp(place, axis=0)), 255).astype(int)
    brute = min(
        cost(triangles, place[:, axis] < at)
        for axis in range(3)
        for at in np.unique(place[:, axis])[1:]
    )
    assert cost(triangles, left) == pytest.approx(brute, rel=2 * bvh_split.BALANCE)
    assert found == pytest.approx(brute, rel=2 * bvh_split.BALANCE)


def test_many_nodes_at_once_equal_one_at_a_time():
    """Nodes are evaluated in padded groups and chunks; neighbours must not leak in."""
    sizes = [2, 3, 300, 16, 17, 33, 700, 5, 256, 257]
    triangles = np.concatenate([soup(n, seed=n) * (i + 1) for i, n in enumerate(sizes)])
    boxes = np.full((6, len(triangles) + 1), np.inf, np.float32)
    boxes[:3, :-1], boxes[3:, :-1] = triangles.min(1).T, -triangles.max(1).T
    centroids = (boxes[:3, :-1] - boxes[3:, :-1]) / 2
    count = np.array(sizes)
    start = np.cumsum(count) - count
    order = np.empty((3, len(triangles)), np.int32)
    for first, size in zip(start, count, strict=True):
        part = slice(first, first + size)
        order[:, part] = first + np.argsort(centroids[:, part], axis=1, kind="stable")
    ordered = bvh_split.Sorted(boxes, centroids, order)
    together = bvh_split.best_cuts(ordered, start, count)
    for i in range(len(sizes)):
        alone = bvh_split.best_cuts(ordered, start[i : i + 1], count[i : i + 1])
        for field in dataclasses.fields(alone):
            assert getattr(alone, field.name)[0] == getattr(together, field.name)[i]


def least_cost(tree, area, node, slots, known):
    """The recurrence of bvh_wide, literally."""
    key = node, slots
    if key in known:
        return known[key]

    def best_split(slots):
        if tree.left[node] < 0:
            return np.inf
        one, two = tree.left[node], tree.left[node] + 1
        return min(
            least_cost(tree, area, one, k, known) + least_cost(tree, area, two, slots - k, known)
            for k in range(1, slots)
        )

    if slots == 1:
        leaf = area[node] if tree.count[node] <= 16 else np.inf
        known[key] = min(leaf, area[node] + best_split(16))
    else:
        fewer = least_cost(tree, area, node, slots - 1, known)
        known[key] = min(fewer, best_split(slots))
    return known[key]


def test_collapse_is_the_cheapest_of_all():
    triangles = soup(1500, size=0.1)
    bvh, tree = build_bvh(triangles), bvh_binary.build_binary(triangles)
    area = bvh_wide._half_areas(tree)
    sides = (bvh.boxes[:, 3:].astype(float) - bvh.boxes[:, :3]).swapaxes(0, 1)
    x, y, z = np.where(bvh.children != UNUSED, sides, 0)
    found = area[0] + (x * y + y * z + z * x).sum()
    assert found == pytest.approx(least_cost(tree, area, 0, 1, {}), rel=1e-9)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e30, 3e38])
def test_refuses_coordinates_that_are_no_place(bad):
    triangles = soup(10)
    triangles[7, 1, 2] = bad
    refused("number 7", build_bvh, triangles)


def test_refuses_wrong_shapes():
    refused(r"\(T, 3, 3\)", build_bvh, np.zeros((3, 3), np.float32))


def test_saved_and_loaded(tmp_path):
    bvh, path = build_bvh(soup(500)), tmp_path / "bvh.npz"
    save_bvh(path, bvh)
    again = load_bvh(path)
    for name in FIELDS:
        assert getattr(bvh, name).tobytes() == getattr(again, name).tobytes()
    assert list(tmp_path.iterdir()) == [path]
    save_bvh(path, dataclasses.replace(bvh, children=bvh.children * 0))
    refused("child", load_bvh, path)
