"""Blocks that span several elements: the same rays, the same surfaces, whatever is asked."""

import numpy as np
import pytest
from tracing_scenes import (
    CAMERA,
    check_luma,
    closed_room,
    lit_soup,
    mesh,
    scene,
    soup,
    traced,
    tracer_of,
)

from lfcore.optics.bundles import macropixels, views
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.oracle.slab import all_pixels, trace
from lfcore.scene.appearance import Material
from lfcore.storage.layout import FrameLayout

pytestmark = pytest.mark.kernels


def spanning(world, spans, device=None):
    """A tracer that is told what its blocks span."""
    return tracer_of(world, device, outer=spans, single_rays=False)


@pytest.mark.parametrize("make", [macropixels, views])
def test_spanning_blocks_see_what_others_see(device, make):
    world = scene(soup(3000, 1, 0.15))
    slab = Slab(CAMERA, 20, 24)
    size = slab.pixels if make is macropixels else slab.views
    places = np.unique(np.random.default_rng(2).integers(0, size, (60, 2)), axis=0)
    bundles = make(slab, places)
    alone, depth = spanning(world, 1, device).bundle_hits(bundles, places)
    for spans in (2, 4):
        triangle, far = spanning(world, spans, device).bundle_hits(bundles, places)
        assert (triangle != alone).mean() < 1e-3  # rays at edges
        same = (triangle == alone) & (triangle >= 0)
        assert same.sum() > 1000
        assert np.abs(far[same] / depth[same] - 1).max() < 1e-4


def rough_wall(slab, first, last):
    """A wall without holes: a corner for each pixel from first to last, on one of its rays."""
    rng, at = np.random.default_rng(5), np.arange(first, last + 1)
    s, t = rng.choice(slab.lens_positions(), (2, len(at), len(at)))
    tangent = slab.pixel_tangents()[at]
    z = rng.uniform(1.7, 2.3, (len(at), len(at)))
    x = s * (1 - z * slab.camera.delta) + z * tangent
    y = t * (1 - z * slab.camera.delta) + z * tangent[:, None]
    return mesh(np.stack([x, y, z], -1))


@pytest.mark.parametrize("spans", [2, 4])
def test_rays_through_vertices_do_not_leak(device, spans):
    slab = Slab(CAMERA, 16, 256)
    tracer = spanning(scene(rough_wall(slab, 90, 166)), spans, device)
    line = np.arange(96, 160)
    pixels = np.stack(np.meshgrid(line, line), -1).reshape(-1, 2)
    triangle, _ = tracer.slab_hits(slab, pixels)
    assert (triangle >= 0).all()


# Planes also where none is looked at: programs of the lit soup, slow to build, are then the same.
LIT_PLANES = [SensorPlane(2.0, 1.0), SensorPlane(0.6, 1.4)]


@pytest.fixture(scope="module")
def lit_rays():
    """The lit soup's colours by the oracle, (12, 12, 16, 16, 3): M = 12, N = 16."""
    slab = Slab(CAMERA, 16, 12)
    return trace(lit_soup(), slab, all_pixels(slab)).reshape(12, 12, 16, 16, 3)


@pytest.mark.parametrize("kind", ["macropixels", "views"])
@pytest.mark.parametrize("spans", [2, 4])
def test_colours_and_shadows_are_the_oracles(device, kind, spans, lit_rays):
    layout = FrameLayout(kind, 16, 12, "raster", 1, "yuv444p")
    frames, _ = traced(spanning(lit_soup(), spans, device), layout, LIT_PLANES)
    rays = lit_rays if kind == "macropixels" else lit_rays.transpose(2, 3, 0, 1, 4)
    check_luma(frames, layout, rays.reshape(-1, *rays.shape[2:]))


@pytest.mark.parametrize("spans", [2, 4])
def test_planes_are_those_of_blocks_of_one_element(spans):
    """Surfaces that only shine have one colour however they are evaluated: sums are equal."""
    shining = Material("shining", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0, (0.3, 0.5, 0.7))
    world = scene(closed_room(), materials=[shining], ambient=(0.0,) * 3)
    planes = [
        SensorPlane(2.0, 1.0),
        SensorPlane(0.6, 2.0, aperture="square"),
        SensorPlane(5.0, 1.4),
    ]
    for kind in ("macropixels", "views"):
        for size in ((16, 13), (21, 13)):
            layout = FrameLayout(kind, *size, "raster", 1, "yuv444p")
            frames, sums = traced(spanning(world, 1), layout, planes)
            again, found = traced(spanning(world, spans), layout, planes)
            assert (frames == again).all()
            np.testing.assert_array_equal(found.sums, sums.sums)


@pytest.mark.parametrize(("room", "sizes"), [(100, [64] * 4), (40, [64] * 4), (30, [30] * 2 + [4])])
def test_chunks_do_not_part_groups(monkeypatch, room, sizes):
    """A chunk ends where a row of groups does, so that no group is traced twice; unless such a row
    takes more than twice the room of a chunk."""
    from lfcore.tracing import chunks

    layout = FrameLayout("macropixels", 16, 16, "raster", 1, "yuv444p")
    monkeypatch.setattr(chunks, "CHUNK_BYTES", layout.frame_bytes * room)
    tracer, slab = spanning(lit_soup(), 4), Slab(CAMERA, 16, 16)
    tracing = tracer.trace_tile(slab, layout.tiles(1 << 30)[0], LIT_PLANES)
    assert [len(chunk.frames) for chunk in tracing][: len(sizes)] == sizes


def test_chunks_leave_room_for_the_encoder_where_packets_share_nothing(monkeypatch):
    from lfcore.tracing import chunks

    layout = FrameLayout("macropixels", 64, 8, "raster", 1, "yuv444p")
    tracer, slab = spanning(lit_soup(), 1), Slab(CAMERA, 64, 8)
    for room, sizes in ((chunks.ENCODER_FRAMES + 24, [24, 24, 16]), (20, [16, 16, 16, 16])):
        monkeypatch.setattr(chunks, "CHUNK_BYTES", layout.frame_bytes * room)
        tracing = tracer.trace_tile(slab, layout.tiles(1 << 30)[0])
        assert [len(chunk.frames) for chunk in tracing] == sizes
