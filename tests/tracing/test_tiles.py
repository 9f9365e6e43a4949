"""Tiles: colours against the oracle, frames of every pixel format, exact sums of planes, and
independence of how work is cut."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scattered_planes import form_plane, scattered_sums
from tracing_scenes import (
    CAMERA,
    closed_room,
    crowd,
    lit_soup,
    mesh,
    painted_soup,
    scene,
    traced,
    tracer_of,
)

from lfcore import DeviceError, SensorPlane, Slab, open_device
from lfcore.optics import bundles
from lfcore.optics.plane_sums import FIXED_ONE
from lfcore.oracle import colour as truth
from lfcore.oracle.slab import all_pixels, trace
from lfcore.refocus import plane_buffers
from lfcore.refocus.plane_buffers import workers_that_fit
from lfcore.rendering import tiles
from lfcore.rendering.tiles import trace_tile
from lfcore.storage.defaults import frame_layout
from lfcore.storage.frame_memory import grid_corner
from lfcore.storage.layout import FrameLayout
from lfcore.storage.pixels import PIXEL_FORMATS
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer

pytestmark = pytest.mark.kernels

PLANES = [
    SensorPlane(2.0, 1.0),
    SensorPlane(1.2, 1.0, aperture="square", normalise="lens"),
    SensorPlane(5.0, 1.7, aperture="polygon"),
    SensorPlane(1.5, 1.0, keep_magnification=True),
]


@pytest.mark.parametrize("pixels", [8, (5, 8)])
@pytest.mark.parametrize("kind", ["macropixels", "views"])
def test_planes_are_the_sums_of_single_rays(device, kind, pixels):
    world, slab = lit_soup(), Slab.of(CAMERA, 9, pixels)
    layout = frame_layout(9, pixels, "yuv444p", kind=kind)
    _, sums = traced(tracer_of(world, device), layout, PLANES)
    rays = trace(world, slab, all_pixels(slab)).reshape(8, -1, 9, 9, 3)
    for plane, picture in zip(PLANES, sums.pictures(), strict=True):
        expected = form_plane(slab, plane, rays)
        error = np.abs(picture - expected)
        assert error.mean() < 2e-4, (plane, error.max(), error.mean(axis=(0, 1)))


@pytest.mark.parametrize("pixels", [(32, 20), (12, 32)])
def test_a_wide_picture_has_the_rays_of_its_square(device, pixels):
    """Frames and sums of the middle of a square picture of the same pixels, to the last bit."""
    world, wide = lit_soup(), Slab.of(CAMERA, 5, pixels)
    square = replace(wide, extent=None)
    left, top, width, height = wide.held.pixels
    tracer = tracer_of(world, device)
    chunks, sums = [], []
    for slab, at in ((wide, (0, 0)), (square, (left, top))):
        layout = frame_layout(5, slab.size, "yuv444p", kind="macropixels", order="raster", pack=1)
        tracing = trace_tile(tracer, slab, layout.tile(*at, width, height), PLANES)
        chunks.append([chunk.frames.copy() for chunk in tracing])
        part, whole = tracing.plane_sums, np.zeros((len(PLANES), 3, 32, 32), np.uint64)
        rows, columns = (slice(first, first + n) for first, n in (
            (part.top, part.sums.shape[2]), (part.left, part.sums.shape[3])
        ))  # fmt: skip
        whole[:, :, rows, columns] = part.sums
        sums.append(whole[:, :, top : top + height, left : left + width])
    np.testing.assert_array_equal(*chunks)
    np.testing.assert_array_equal(*sums)


@pytest.mark.parametrize("kind", ["macropixels", "views"])
@pytest.mark.parametrize(
    ("make", "way"),
    [
        (lit_soup, {"spanning": False}), (lit_soup, {"spanning": True}),
        (crowd, {}), (crowd, {"single_rays": True}),
    ],
)  # fmt: skip
def test_tiles_threads_and_order_do_not_matter(kind, make, way):
    two, one = (tracer_of(make(), open_device(threads=threads), **way) for threads in (2, 1))
    size = (18, 16) if make is lit_soup else (16, 8)
    whole = FrameLayout(kind, *size, "raster", 1, "yuv444p")
    frames, sums = traced(two, whole, PLANES)
    # Rows of elements, which part groups.
    again, cut = traced(one, whole, PLANES, max_rays=24 * math.prod(whole.inner))
    assert (frames == again).all() and (sums.sums == cut.sums).all()
    _, packed = traced(two, FrameLayout(kind, *size, "hilbert", 4, "yuv444p"), PLANES)
    assert (sums.sums == packed.sums).all()


# Every ray on its own pixel, several on one, most beside the picture, pixels moved unevenly, fewer
# pixels than the slab's.
MANY_PLANES = [
    SensorPlane(2.0, 1.0),
    SensorPlane(0.4, 1.0, aperture="square"),
    SensorPlane(5.0, 1.7, aperture="polygon"),
    SensorPlane(2.05, 1.0, aperture="square"),
    SensorPlane(1.0, 1.0, keep_magnification=True),
    SensorPlane(2.0, 1000.0),
    SensorPlane(0.7, 1.0, pixels=4),
    SensorPlane(5.0, 1.7, aperture="square", pixels=3, keep_magnification=True),
    SensorPlane(1.0, 1.0, pixels=1),
]
# Packets of 4 x 4, 2 x 2 and single pixels; lens grids that fill their blocks and that do not;
# lit, which is slow to build, in packets of one block an element and of several.
SIZES = [
    (3, 13, painted_soup), (16, 11, lit_soup), (16, 12, lit_soup), (20, 9, painted_soup),
    (40, 5, lit_soup), (70, 4, painted_soup),
]  # fmt: skip


def fixed_point(colours):
    """Whole numbers of 2^-20, as the kernels round: once to float32 after adding a half."""
    clamped = np.clip(colours, 0, 1).astype(np.float64)
    return (clamped * FIXED_ONE + 0.5).astype(np.float32).astype(np.uint64)


def formed(tracer, layout, planes=MANY_PLANES, **how):
    return traced(tracer, layout, planes, **({"frames": False} | how))[1].sums


@pytest.mark.parametrize("views, pixels, make", SIZES)
def test_sums_are_every_ray_alone(views, pixels, make, monkeypatch):
    tracer = tracer_of(make(), open_device(threads=1))
    slab = Slab(CAMERA, views, pixels)
    places = all_pixels(slab)
    colours = tracer.bundle_radiance(bundles.macropixels(slab, places), places)
    rays = fixed_point(colours).reshape(pixels, pixels, views, views, 3)
    layout = FrameLayout("macropixels", views, pixels, "serpentine", 1, "yuv444p")
    sums = formed(tracer, layout)
    for plane, found in zip(MANY_PLANES, sums, strict=True):
        expected, side = scattered_sums(slab, plane, rays), plane.side(slab)
        np.testing.assert_array_equal(found[:, :side, :side], expected, str(plane))
    # Tiles that begin and end amid a packet.
    for most in (2, 2 * pixels):
        np.testing.assert_array_equal(formed(tracer, layout, max_rays=most * views**2), sums)
    # Chunks of a few elements, even in a picture this small.
    monkeypatch.setattr(tiles, "CHUNK_RAYS", 3 * views**2)
    np.testing.assert_array_equal(formed(tracer, layout), sums)


@pytest.mark.parametrize("views, pixels", [(16, 40), (64, 17), (200, 9), (1024, 1)])
def test_no_sum_of_white_rays_overflows(views, pixels):
    white_room = scene(closed_room(1), background=(1, 1, 1), ambient=(9, 9, 9))
    tracer = tracer_of(white_room, open_device(threads=1))
    planes = [SensorPlane(CAMERA.focus_m, CAMERA.f_number, aperture="square")]
    sums = formed(tracer, FrameLayout("macropixels", views, pixels), planes)
    assert (sums == views**2 * FIXED_ONE).all()


def test_workers_are_as_many_as_memory_has_sums_for(monkeypatch):
    about = SimpleNamespace(max_mem_alloc_size=20 << 30, global_mem_size=64 << 30)
    wide = SimpleNamespace(threads=64 * 132, device=about, name="a wide one")
    assert workers_that_fit(wide, 1 << 10) == wide.threads
    assert workers_that_fit(wide, 42 << 20) == (16 << 30) // (42 << 20)
    with pytest.raises(DeviceError, match=r"17\.0 GiB, and a wide one has room for 16\.0.*fewer"):
        workers_that_fit(wide, 17 << 30)
    layout = FrameLayout("macropixels", 3, 13)
    tracer = tracer_of(painted_soup(), open_device(threads=2))
    many = formed(tracer, layout)
    monkeypatch.setattr(plane_buffers, "workers_that_fit", lambda device, each: 1)
    assert (formed(tracer, layout) == many).all()


SPANNING = {8: None, 10: True, 12: False}
MADE = {"macropixels": bundles.macropixels, "views": bundles.views}
# (kind, views, pixels, pack): inner grids that are odd, smaller and larger than a block, in frames
# with empty slots, and with a margin around all.
LAYOUTS = [
    ("macropixels", 33, 6, 4), ("views", 3, 37, 2), ("views", 4, 5, 2),
    ("macropixels", 18, (5, 8), 4), ("views", 3, (37, 20), 2),
]  # fmt: skip


def painted_wall():
    """A wall whose colours change smoothly: triangles share the colours of common corners.

    Rays that differ in their last bits differ no more than that in colour.
    """
    y, x = np.mgrid[-4:5, -4:5]
    corners = np.stack([x, y, np.ones_like(x)], -1) * [0.1, 0.1, 1.6]
    colours = np.random.default_rng(4).random((9, 9, 3)) ** 3
    white = (1.2, 1.2, 1.2)
    return scene(mesh(corners), colours=mesh(colours), ambient=white, background=(0, 0, 0))


@pytest.fixture(scope="module")
def tracers():
    """One of one lane, and one for each number of bits: each way to cut packets with some."""
    world = painted_wall()
    bvh, wide = build_bvh(world.triangles), open_device(threads=2)
    made = {bits: Tracer(world, bvh, wide, spanning=way) for bits, way in SPANNING.items()}
    return made | {1: Tracer(world, bvh, open_device(threads=2, lanes=1))}


def codes_of(encoded, form):
    """(..., 3) float64 codes, not rounded, of sRGB-encoded (..., 3), in the order of planes."""
    if form.rgb:
        return encoded[..., [1, 2, 0]] * (2**form.bits - 1)
    return truth.ycbcr(encoded, form.bits)


def expected_planes(tracer, layout):
    """Three planes (F, h, w) float64 of codes, not rounded: ray by ray, black where none is."""
    slab, form = Slab.of(CAMERA, layout.views, layout.size), layout.format
    tile = layout.tile(0, 0, *layout.outer)
    elements = tile.elements()
    places = elements + grid_corner(tile, slab)
    light = tracer.bundle_radiance(MADE[layout.kind](slab, places), places)
    codes = codes_of(truth.srgb_encode(np.clip(light, 0, 1)), form)
    (columns, rows), (wide, high) = layout.inner, layout.slot
    beyond = (0, 0), (0, high - rows), (0, wide - columns), (0, 0)
    codes = np.pad(codes, beyond, mode="edge")
    size, step = (layout.frame_height, layout.frame_width), form.subsampling
    planes = np.empty((3, tile.frame_count, *size))
    planes[:] = codes_of(np.zeros(3), form)[:, None, None, None]
    for element, (frame, x, y) in zip(codes, tile.placement(elements), strict=True):
        planes[0, frame, y : y + rows, x : x + columns] = element[:rows, :columns, 0]
        for plane in (1, 2):
            planes[plane, frame, y : y + high, x : x + wide] = element[..., plane]
    small = [p.reshape(len(p), size[0] // step, step, -1, step).mean((2, 4)) for p in planes[1:]]
    return [planes[0], *small]


@pytest.mark.parametrize("name", sorted(PIXEL_FORMATS))
@pytest.mark.parametrize(("kind", "views", "pixels", "pack"), LAYOUTS)
def test_codes_are_those_of_the_formula(tracers, name, kind, views, pixels, pack):
    layout = frame_layout(views, pixels, name, kind=kind, order="raster", pack=pack)
    tracer = tracers[layout.format.bits]
    frames = traced(tracer, layout)[0]
    planes = layout.format.views(frames, layout.frame_width, layout.frame_height)
    # Half a code of rounding, and the error of the encoding.
    limit = {8: 0.6, 10: 0.52, 12: 0.55}[layout.format.bits]
    for found, expected in zip(planes, expected_planes(tracer, layout), strict=True):
        assert np.abs(found - expected).max() < limit
        assert np.unique(found).size > 10


@pytest.mark.parametrize("name", ["gbrp", "yuv444p"])  # others: digests.py
def test_one_lane_gives_the_same_codes(tracers, name):
    layout = FrameLayout("views", 3, 37, "raster", 2, name)
    narrow, wide = (traced(tracers[which], layout)[0] for which in (1, 8))
    np.testing.assert_array_equal(narrow, wide)
