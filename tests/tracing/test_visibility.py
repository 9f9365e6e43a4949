"""Closest hits: bundles, blocks of one element and single rays against the oracle and Embree."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from tracing_scenes import CAMERA, LAMP, check_hits, closed_room, colours, scene, soup, tracer_of

from lfcore import Slab
from lfcore.optics.bundles import macropixels, views
from lfcore.oracle.intersect import closest_hits
from lfcore.oracle.slab import slab_hits
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.packets import PACKET_ROWS
from lfcore.tracing.tracer import Tracer

# How rays are followed: as the scene asks for, by blocks of some elements, or one by one.
WAYS = [
    {},
    *(
        pytest.param(way, marks=pytest.mark.kernels, id=str(way))
        for way in (
            {"spanning": True, "single_rays": False}, {"single_rays": True},
        )
    ),
]  # fmt: skip


def some_pixels(size, count, seed=0):
    return np.random.default_rng(seed).integers(0, size, (count, 2))


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("views_a_side", [1, 5, 8, 16, 21, 40])
@pytest.mark.parametrize("seed", range(3))
def test_slab_hits_are_the_oracles_on_soups(device, way, views_a_side, seed):
    tracer = tracer_of(soup(120, seed), device, **way)
    check_hits(tracer, Slab(CAMERA, views_a_side, 24), some_pixels(24, 12, seed))


def test_pixels_come_in_any_order_and_more_than_once(device):
    """And beside the picture, where numbers are negative."""
    tracer, slab = tracer_of(soup(500, 3), device), Slab(CAMERA, 6, 24)
    grid = np.stack(np.meshgrid(np.arange(-3, 27), np.arange(-2, 26)), -1).reshape(-1, 2)
    triangle, depth = tracer.slab_hits(slab, grid)
    assert len(np.unique(triangle)) > 50
    chosen = np.random.default_rng(1).integers(0, len(grid), 300)
    assert len(np.unique(chosen)) < len(chosen)
    for dtype in (np.int32, np.int64):
        again, far = tracer.slab_hits(slab, grid[chosen].astype(dtype))
        assert np.array_equal(again, triangle[chosen]) and np.array_equal(far, depth[chosen])


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("make", [macropixels, views])
def test_bundles_of_either_kind_agree_with_embree(device, make, way):
    tracer = tracer_of(soup(3000, 1, 0.15), device, **way)
    slab = Slab(CAMERA, 33, 40)
    grid = slab.pixels if make is macropixels else slab.views
    places = np.unique(some_pixels(grid, 30), axis=0)
    bundles = make(slab, places)
    triangle, depth = tracer.bundle_hits(bundles, places)
    origins, directions = (a.reshape(-1, 3).astype(np.float32) for a in bundles.rays())
    embree = EmbreeScene()
    TriangleMesh(embree, tracer.scene.triangles)
    found = embree.run(origins, directions, query="INTERSECT", output=1)
    differ = found["primID"] != triangle.ravel()
    assert differ.mean() < 2e-3  # rays at edges, where float32 may go either way
    same = ~differ & (triangle.ravel() >= 0)
    assert same.sum() > 1000
    assert np.abs(found["tfar"][same] / depth.ravel()[same] - 1).max() < 1e-4


@pytest.mark.parametrize("spanning", [False, True])
def test_blocks_lose_no_triangle_that_falls_between_rays(device, spanning):
    # As small as the way from ray to ray, in focus and out of it, where rays cross too.
    tracer = tracer_of(soup(20_000, 1, 0.03), device, spanning=spanning)
    slab = Slab(CAMERA, 16, 64)
    places = np.stack(np.meshgrid(np.arange(64), np.arange(24, 40)), -1).reshape(-1, 2)
    bundles = macropixels(slab, places)
    triangle, depth = tracer.bundle_hits(bundles, places)
    origins, directions = (a.reshape(-1, 3).astype(np.float32) for a in bundles.rays())
    found, distance, _ = tracer.closest_hit(origins, directions)
    same = found == triangle.ravel()
    assert (found >= 0).mean() > 0.2
    assert (~same).mean() < 1e-5  # rays at edges
    seen = same & (found >= 0)
    assert np.abs(distance[seen] / depth.ravel()[seen] - 1).max() < 1e-4


@pytest.mark.parametrize("way", WAYS[:-1])
def test_nothing_leaks_out_of_a_closed_room(device, way):
    for offset in (0.0, 0.37):
        tracer = tracer_of(closed_room(4) + [offset, -offset, 0.1], device, **way)
        triangle, _ = tracer.slab_hits(Slab(CAMERA, 64, 32), some_pixels(32, 64))
        assert (triangle >= 0).all()


def test_rays_aimed_at_edges_and_vertices_never_leak(device):
    room = closed_room().astype(np.float32)
    tracer, rng = tracer_of(room, device), np.random.default_rng(2)
    count = 100_000
    origins = rng.uniform(-0.5, 0.5, (count, 3)).astype(np.float32)
    face, along = rng.integers(0, len(room), count), rng.random((count, 1))
    along[: count // 2] = 0
    aim = room[face, 0] * (1 - along) + room[face, 1] * along
    triangle, distance, weights = tracer.closest_hit(origins, (aim - origins).astype(np.float32))
    assert (triangle >= 0).all()
    assert np.abs(distance - 1).max() < 1e-5
    assert np.abs(weights.sum(1) - 1).max() < 1e-5


@pytest.mark.parametrize("seed", range(4))
def test_single_rays_are_the_oracles(device, seed):
    rng = np.random.default_rng(seed)
    tracer = tracer_of(soup(400, seed), device)
    origins = rng.uniform(-2, 4, (2000, 3)).astype(np.float32)
    directions = (rng.normal(size=(2000, 3)) * 10.0 ** rng.uniform(-6, 6, (2000, 1))).astype("f4")
    directions[:100, 0] = 0
    directions[50:150, 1] = 0
    truth = closest_hits(tracer.scene.triangles, origins, directions)
    triangle, distance, _ = tracer.closest_hit(origins, directions)
    clear = truth.clear(16)
    assert (triangle == truth.triangle)[clear].all()
    hit = clear & (truth.triangle >= 0)
    # Coordinates relative to the origin are rounded, so their size is what an error is measured by.
    corners = tracer.scene.triangles[triangle[hit]] - origins[hit][:, None]
    reach = np.linalg.norm(corners, axis=2).max(1) / np.linalg.norm(directions[hit], axis=1)
    bound = 16 * 2.0**-24 * np.maximum(truth.grazing[hit], 1) * np.maximum(reach, truth.t[hit])
    assert (np.abs(distance[hit] - truth.t[hit]) <= bound).all()


@pytest.mark.parametrize("single_rays", [False, True])
def test_one_pass_or_two_and_rows_or_all_give_the_same(device, single_rays):
    tracer = tracer_of(scene(soup(200, 3), lights=[LAMP]), device, single_rays=single_rays)
    bundles = views(Slab(CAMERA, 3, 150), np.array([[0, 0], [2, 1]]))
    whole = [tracer.bundle_radiance(bundles), *tracer.bundle_hits(bundles)[::-1]]
    assert np.isfinite(whole[1]).any() and np.isinf(whole[1]).any()
    for band in ((0, 150), (0, PACKET_ROWS), (PACKET_ROWS, PACKET_ROWS), (2 * PACKET_ROWS, 22)):
        rows = replace(bundles, band=band)
        some = [*tracer.radiance_and_depth(rows), tracer.bundle_hits(rows)[0]]
        for all_of, these in zip(whole, some, strict=True):
            np.testing.assert_array_equal(these, all_of[:, band[0] : sum(band)])


@pytest.mark.parametrize("tracing", [*WAYS, {"spanning": False}])
def test_copies_at_one_place_go_to_the_lowest_index(device, tracing):
    """Rewound or flipped, whichever of them has the lowest number."""
    triangles = np.float32(soup(60, 5, 0.6))
    orders = list(itertools.permutations(range(3)))
    copies = np.concatenate([triangles[:, order] for order in orders[1:] + orders[:1]])
    world, slab, pixels = scene(copies), Slab(CAMERA, 16, 16), some_pixels(16, 16)
    found = tracer_of(world, device, **tracing).slab_hits(slab, pixels)[0]
    alone = Tracer(world, build_bvh(copies[:60]), device, **tracing).slab_hits(slab, pixels)[0]
    expected = slab_hits(world, slab, pixels).triangle
    assert (found == alone).all() and found.max() > 0
    assert expected.max() < 60 and (found.ravel() != expected).mean() < 1e-3  # rays at edges


def test_what_is_degenerate_behind_the_lens_or_not_there_is_missed(device):
    point = np.tile(np.float32([0, 0, 1]), (5, 3, 1))
    tracer = tracer_of(np.concatenate([point, soup(50, 6)]), device)
    bad = np.float32([[np.nan, 0, 0], [np.inf, 0, 0], [0, 0, 0]])
    triangle, distance, weights = tracer.closest_hit(np.zeros((3, 3), np.float32), bad)
    assert (triangle == -1).all() and np.isinf(distance).all() and np.isnan(weights).all()
    seen, _ = tracer.slab_hits(Slab(CAMERA, 16, 16), some_pixels(16, 16))
    assert ((seen == -1) | (seen >= 5)).all()
    for triangles in (soup(50, 7) * [1, 1, -1], np.zeros((0, 3, 3))):
        tracer = tracer_of(triangles, device)
        triangle, depth = tracer.slab_hits(Slab(CAMERA, 4, 4), [[0, 0], [3, 2]])
        assert (triangle == -1).all() and np.isinf(depth).all()


def plate(z, size=40.0):
    """One triangle that fills the picture."""
    return np.array([[[-size, -size, z], [size, -size, z], [0, size, z]]])


def edge_on():
    """Triangles whose planes go through the lens: rays see them from both sides."""
    rng = np.random.default_rng(3)
    corners = rng.uniform([0, -0.6, 0.8], [0, 0.6, 4.0], (40, 3, 3))
    corners[..., 0] = (
        rng.uniform(-0.04, 0.04, (40, 1)) + rng.uniform(-0.02, 0.02, (40, 1)) * corners[..., 2]
    )
    return corners


SEEN = np.array([0.0146, -0.0146, 1.0])
"""The middle of what the first of two_pixels sees a metre away: a square of 25 mm."""


def tiles(count, depths):
    """Rectangles along rows and columns of what a pixel sees, some at the same depth."""
    rng = np.random.default_rng(count)
    lo = rng.uniform(-0.015, 0.005, (count, 2))
    hi = lo + rng.uniform(0.004, 0.015, (count, 2))
    z = 0.02 * rng.integers(0, depths, count)
    a, b, c, d = (
        np.stack([x[:, 0], y[:, 1], z], 1) for x, y in ((lo, lo), (hi, lo), (hi, hi), (lo, hi))
    )
    return SEEN + np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def crossing(count, seed):
    """Triangles about as large as what a pixel sees, that pass through each other."""
    return SEEN + np.random.default_rng(seed).uniform(-0.03, 0.03, (count, 3, 3))


FEW = {
    "tiles": np.concatenate([tiles(12, 3), plate(1.5)]),
    "tiles in one plane": np.concatenate([tiles(10, 1), plate(1.0)]),
    "crossing": np.concatenate([crossing(8, 1), plate(1.0)]),
    "crossing before nothing": crossing(12, 2),
    "mesh": np.concatenate([trimesh.creation.icosphere(1, 0.012).triangles + SEEN, plate(1.1)]),
}
SCENES = {
    **FEW,
    "large": soup(60, 1, 1.0),
    "hidden": np.concatenate([soup(100, 4), plate(0.5)]),
    "before a wall": np.concatenate([soup(20, 5), plate(5.0)]),
    "edge-on": np.concatenate([edge_on(), plate(6.0)]),
}


def two_pixels(slab):
    return [[slab.pixels // 2, slab.pixels // 2 - 1], [1, slab.pixels - 2]]


@pytest.mark.parametrize("name", SCENES)
def test_triangles_are_the_oracles(device, name):
    slab = Slab(CAMERA, 40, 24)
    check_hits(tracer_of(SCENES[name], device, spanning=False), slab, two_pixels(slab), least=0.1)


@pytest.mark.kernels
@pytest.mark.parametrize("name", ["mesh", "crossing"])
def test_few_triangles_have_the_oracles_colours(device, name):
    """A mesh of few triangles to a block, and one whose triangles pass through each other."""
    slab = Slab(CAMERA, 100, 24)
    world, pixels = scene(FEW[name], lights=[LAMP]), two_pixels(slab)
    found, truth = colours(world, macropixels(slab, pixels), pixels, device, spanning=False)
    assert np.ptp(found) > 0.1
    assert (np.abs(found - truth).max(-1) > 1e-4).mean() < 5e-3
