"""Blocks that span several elements, rays that are followed one by one, and bad input."""

import statistics
import time
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from tracing_scenes import (
    CAMERA,
    check_luma,
    closed_room,
    crowd,
    flat,
    lit_soup,
    mesh,
    scene,
    soup,
    traced,
    tracer_of,
)

from lfcore import Material, SensorPlane, Slab
from lfcore.evaluation.stability.measurement import mismatches
from lfcore.evaluation.stability.shapes import random_rays, single
from lfcore.evaluation.stability.shapes import soup as measured_soup
from lfcore.evaluation.stability.tested_tracer import TracerUnderTest, kept
from lfcore.optics.bundles import macropixels, views
from lfcore.oracle.intersect import closest_hits
from lfcore.oracle.slab import all_pixels, trace
from lfcore.rendering import tiles
from lfcore.rendering.tiles import trace_tile
from lfcore.storage.layout import FrameLayout
from lfcore.tracing import job
from lfcore.tracing.layouts import INTERFACE
from lfcore.tracing.plan import probe

pytestmark = pytest.mark.kernels


def spanning(world, spans, device=None):
    """A tracer whose blocks span elements or do not."""
    return tracer_of(world, device, spanning=spans, single_rays=False)


def rough_wall(slab, pixels, depths_m, rng):
    """A wall without holes: one vertex on a ray of each of K x K pixels."""
    s, t = rng.choice(slab.lens_positions(), (2, len(pixels), len(pixels)))
    tangent = slab.pixel_tangents()[pixels]
    z = rng.uniform(*depths_m, s.shape)
    lens = np.stack([s, t], -1) * (1 - z * slab.camera.delta)[..., None]
    return mesh(np.dstack([lens + z[..., None] * np.stack(np.meshgrid(tangent, tangent), -1), z]))


@pytest.mark.parametrize("count, spans", [(16, True), (8, False), (4, True), (2, True)])
def test_rays_through_vertices_do_not_leak(device, count, spans):
    """Nor do they where all triangles around a vertex are edge-on for some ray of a block."""
    slab = Slab(CAMERA, count, 256)
    wall = rough_wall(slab, np.arange(90, 167), (1.7, 2.3), np.random.default_rng(5))
    pixels = np.argwhere(np.ones((64, 64))) + 96
    triangle, _ = spanning(scene(wall), spans, device).slab_hits(slab, pixels)
    assert (triangle >= 0).all()


# Planes also where none is looked at: programs of the lit soup, slow to build, are then the same.
LIT_PLANES = [SensorPlane(2.0, 1.0), SensorPlane(0.6, 1.4)]


@pytest.fixture(scope="module")
def lit_rays():
    """The lit soup's colours by the oracle, (12, 12, 16, 16, 3): M = 12, N = 16."""
    slab = Slab(CAMERA, 16, 12)
    return trace(lit_soup(), slab, all_pixels(slab)).reshape(12, 12, 16, 16, 3)


@pytest.mark.parametrize("kind", ["macropixels", "views"])
def test_colours_and_shadows_are_the_oracles(device, kind, lit_rays):
    layout = FrameLayout(kind, 16, 12, "raster", 1, "yuv444p")
    frames, _ = traced(spanning(lit_soup(), True, device), layout, LIT_PLANES)
    rays = lit_rays if kind == "macropixels" else lit_rays.transpose(2, 3, 0, 1, 4)
    check_luma(frames, layout, rays.reshape(-1, *rays.shape[2:]))


@pytest.mark.parametrize("make", [macropixels, views])
def test_radiance_is_that_of_blocks_of_one_element(device, make):
    """Of some elements and an inner grid that is no multiple of a block, two sets added up."""
    slab = Slab(CAMERA, 10, 14)
    size = slab.pixels if make is macropixels else slab.views
    places = np.unique(np.random.default_rng(4).integers(0, size, (60, 2)), axis=0)
    bundles = make(slab, places)
    tracer = spanning(lit_soup(), True, device)
    found, alone = tracer.bundle_radiance(bundles, places), tracer.bundle_radiance(bundles)
    assert found.std() > 0.1
    assert (np.abs(found - alone).max(-1) > 1e-3).mean() < 2e-3  # rays at edges
    twice = tracer.mosaic_radiance([bundles, bundles], 1)
    np.testing.assert_array_equal(twice, 2 * alone.reshape(twice.shape))


def test_planes_are_those_of_blocks_of_one_element():
    """Surfaces that only shine have one colour however they are evaluated: sums are equal."""
    shining = Material("shining", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0, (0.3, 0.5, 0.7))
    world = flat(closed_room(), materials=[shining], ambient=(0.0,) * 3)
    planes = [SensorPlane(2.0, 1.0), SensorPlane(0.6, 2.0, "square"), SensorPlane(5.0, 1.4)]
    for kind in ("macropixels", "views"):
        for size in ((16, 13), (21, 13)):
            layout = FrameLayout(kind, *size, "raster", 1, "yuv444p")
            frames, sums = traced(spanning(world, False), layout, planes)
            again, found = traced(spanning(world, True), layout, planes)
            assert (frames == again).all()
            np.testing.assert_array_equal(found.sums, sums.sums)


@pytest.mark.parametrize(("room", "sizes"), [(100, [64] * 4), (40, [64] * 4), (7, [7] * 36 + [4])])
def test_chunks_do_not_part_groups(monkeypatch, room, sizes):
    """A chunk ends where a row of groups does, so that no group is traced twice, unless such a row
    is MOST_GROWTH times as large."""
    layout = FrameLayout("macropixels", 16, 16, "raster", 1, "yuv444p")
    monkeypatch.setattr(tiles, "CHUNK_RAYS", 16**2 * room)
    tracer, slab = spanning(lit_soup(), True), Slab(CAMERA, 16, 16)
    tracing = trace_tile(tracer, slab, layout.tiles(1 << 30)[0], LIT_PLANES)
    assert [len(chunk.frames) for chunk in tracing] == sizes


@pytest.mark.parametrize(("make", "way"), [(lit_soup, {"single_rays": True}), (crowd, {})])
def test_single_rays_have_the_oracles_colours(device, make, way):
    world = make()
    slab = Slab(world.camera, 16, 5)
    tracer = tracer_of(world, device, **way)
    if not way:  # enough triangles a block that its shadow rays go one by one
        seen, _ = tracer.slab_hits(slab, all_pixels(slab))
        assert statistics.median(len(np.unique(block)) for block in seen) > 128
    layout = FrameLayout("macropixels", 16, 5, "raster", 1, "yuv444p")
    frames, _ = traced(tracer, layout, LIT_PLANES)
    check_luma(frames, layout, trace(world, slab, all_pixels(slab)))


def test_colours_without_float64_are_the_oracles(device, monkeypatch):
    without = replace(INTERFACE)
    without.__dict__["header"] = "#undef cl_khr_fp64\n#define double none\n" + INTERFACE.header
    monkeypatch.setattr(job, "INTERFACE", without)
    test_single_rays_have_the_oracles_colours(device, lit_soup, {"single_rays": True})


def test_coarse_pictures_of_dense_scenes_are_traced_ray_by_ray():
    rng = np.random.default_rng(1)
    middle = rng.uniform([-2, -2, 3], [2, 2, 6], (60_000, 1, 3))
    tracer = tracer_of(middle + rng.normal(size=(60_000, 3, 3)) * 0.004)
    assert tracer.plan.single_rays(probe(Slab(CAMERA, 8, 16), macro=False))
    assert not tracer.plan.single_rays(probe(Slab(CAMERA, 64, 512)))
    room = tracer_of(closed_room())
    assert not room.plan.single_rays(probe(Slab(CAMERA, 8, 16), macro=False))


def times_as_long(worse, good):
    """The time that one call takes over that of another."""

    def spent(call):
        begun = time.process_time()
        call()
        return time.process_time() - begun

    spent(good)
    return statistics.median(spent(worse) / spent(good) for _ in range(7))


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
    calls = (partial(tracer.slab_hits, slab, pixels) for tracer in (worse, good))
    assert times_as_long(*calls) < 2.5


def test_bad_rays_cost_little(device):
    tracer = tracer_of(soup(2000, 4), device)
    rng = np.random.default_rng(0)
    origins = np.zeros((200_000, 3), np.float32)
    good = rng.normal(size=origins.shape).astype(np.float32)
    bad = good.copy()
    bad[::4], bad[1::4, 0], bad[2::4, 1] = 0, np.nan, np.inf
    calls = (partial(tracer.closest_hit, origins, directions) for directions in (bad, good))
    assert times_as_long(*calls) < 2.5


PATTERNS = (np.nan, np.inf, -np.inf, 3e38, 1e-45)


@pytest.fixture(scope="module")
def tracer():
    return TracerUnderTest()


@pytest.mark.parametrize("pattern", PATTERNS)
def test_sound_rays_do_not_notice_spoilt_ones(tracer, pattern):
    mesh, rays = single(measured_soup(500)), random_rays(1000)
    origins, directions = (part.copy() for part in rays)
    origins[0::4, 0] = pattern
    directions[2::4, 0] = pattern
    clean, found = tracer.closest(mesh, *rays), tracer.closest(mesh, origins, directions)
    for before, after in zip(clean, found, strict=True):
        np.testing.assert_array_equal(after[1::2], before[1::2])
    if not np.isfinite(pattern):
        assert (found[0][0::2] == -1).all()


@pytest.mark.parametrize("pattern", [*PATTERNS, "random bits"])
def test_spoilt_triangles_are_never_met(tracer, pattern):
    mesh, rays, rng = single(measured_soup(300)), random_rays(1000), np.random.default_rng(14)
    if pattern == "random bits":
        bad = rng.integers(0, 2**32, (300, 3, 3), np.uint32).view(np.float32)
        bad = bad[~kept(bad)]
    else:
        bad = mesh.copy()
        bad[np.arange(300), rng.integers(0, 3, 300), rng.integers(0, 3, 300)] = pattern
    both = np.concatenate([mesh, bad])
    keep = np.append(np.flatnonzero(kept(both)), -1)
    hits = closest_hits(both[keep[:-1]], *rays)
    assert mismatches(tracer.closest(both, *rays), replace(hits, triangle=keep[hits.triangle])) == 0
