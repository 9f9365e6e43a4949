"""Rays followed one by one, and what bad input costs."""

import statistics
import time

import numpy as np
import pytest
from tracing_scenes import (
    CAMERA,
    check_luma,
    closed_room,
    crowd,
    lit_soup,
    soup,
    traced,
    tracer_of,
)  # fmt: skip

from lfcore.optics.bundles import macropixels, views
from lfcore.optics.slab import Slab
from lfcore.oracle.slab import all_pixels, trace
from lfcore.storage.layout import FrameLayout
from lfcore.tracing import job
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.plan import leaves_a_ray, probe

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize(("make", "way"), [(lit_soup, {"single_rays": True}), (crowd, {})])
def test_colours_and_shadows_are_the_oracles(device, make, way):
    world = make()
    slab = Slab(world.camera, 16, 5)
    tracer = tracer_of(world, device, **way)
    if not way:  # enough triangles a block that its shadow rays go one by one
        seen, _ = tracer.slab_hits(slab, all_pixels(slab))
        assert statistics.median(len(np.unique(block)) for block in seen) > 128
    layout = FrameLayout("macropixels", 16, 5, "raster", 1, "yuv444p")
    check_luma(traced(tracer, layout)[0], layout, trace(world, slab, all_pixels(slab)))


def test_colours_without_float64_are_the_oracles(device, monkeypatch):
    without = "#undef cl_khr_fp64\n#define double none\n" + job.header()
    monkeypatch.setattr(job, "header", lambda: without)
    test_colours_and_shadows_are_the_oracles(device, lit_soup, {"single_rays": True})


def test_coarse_pictures_of_dense_scenes_are_traced_ray_by_ray():
    rng = np.random.default_rng(1)
    middle = rng.uniform([-2, -2, 3], [2, 2, 6], (60_000, 1, 3))
    tracer = tracer_of(middle + rng.normal(size=(60_000, 3, 3)) * 0.004)
    assert tracer.plan.single_rays(probe(Slab(CAMERA, 8, 16), macro=False))
    assert not tracer.plan.single_rays(probe(Slab(CAMERA, 64, 512)))
    room = tracer_of(closed_room())
    assert not room.plan.single_rays(probe(Slab(CAMERA, 8, 16), macro=False))


@pytest.mark.parametrize("make", [macropixels, views])
def test_leaves_in_the_way_are_counted(make):
    slab = Slab(CAMERA, 20, 24)
    bvh = build_bvh(soup(2000, 3).astype(np.float32))
    places = np.array([[3, 5], [11, 17]])
    bundles = make(slab, places)
    origins, directions = bundles.rays()
    origins, directions = origins[:, :16, :16], directions[:, :16, :16]
    lo, hi = bvh.leaf_boxes[:, None, :3], bvh.leaf_boxes[:, None, 3:]
    met = 0
    for o, d in zip(origins.reshape(2, -1, 3), directions.reshape(2, -1, 3), strict=True):
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (lo - o) / d, (hi - o) / d
        near, far = np.minimum(a, b).max(-1), np.maximum(a, b).min(-1)
        met += (np.maximum(near, 0) <= far).any(1).sum()
    first = leaves_a_ray(bvh.leaf_boxes, bundles)
    assert first == leaves_a_ray(bvh.leaf_boxes, bundles)
    assert met / 4 < first * 2 * 16 * 16 < 4 * met


def spent(tracer, slab, pixels):
    begun = time.process_time()
    tracer.slab_hits(slab, pixels)
    return time.process_time() - begun


def test_bad_triangles_cost_little(device):
    """A scene, and the same with as many degenerate, duplicate and needle triangles again."""
    clean = soup(4000, 2).astype(np.float32)
    points = np.repeat(clean[:1500, :1], 3, axis=1)
    lines = np.stack([clean[1500:2500, 0], clean[1500:2500, 1], clean[1500:2500, 1]], axis=1)
    needles = np.stack([clean[2500:3000, 0], clean[2500:3000, 1], clean[2500:3000, 1] + 1e-6], 1)
    bad = np.concatenate([clean, points, lines, needles, clean[3000:]]).astype(np.float32)
    slab = Slab(CAMERA, 32, 64)
    pixels = np.stack(np.meshgrid(np.arange(24), np.arange(24)), -1).reshape(-1, 2)
    good, worse = (tracer_of(t, device) for t in (clean, bad))
    first, second = good.slab_hits(slab, pixels), worse.slab_hits(slab, pixels)
    neighbour = first[0] != second[0]
    assert (second[0][neighbour] >= len(clean)).all()  # only a needle may stand before it
    ratios = [spent(worse, slab, pixels) / spent(good, slab, pixels) for _ in range(7)]
    assert statistics.median(ratios) < 2.5


def test_bad_rays_cost_little(device):
    tracer = tracer_of(soup(2000, 4), device)
    rng = np.random.default_rng(0)
    origins = np.zeros((200_000, 3), np.float32)
    good = rng.normal(size=origins.shape).astype(np.float32)
    bad = good.copy()
    bad[::4], bad[1::4, 0], bad[2::4, 1] = 0, np.nan, np.inf
    tracer.closest_hit(origins, good)

    def seconds(directions):
        begun = time.process_time()
        tracer.closest_hit(origins, directions)
        return time.process_time() - begun

    assert statistics.median(seconds(bad) / seconds(good) for _ in range(5)) < 2.5
