"""Frames of every pixel format, against the formulas in float64 and through a lossless codec."""

import numpy as np
import pytest
from stored_fields import segment_frames
from tracing_scenes import CAMERA, mesh, scene

from lfcore.opencl.device import open_device
from lfcore.optics import bundles
from lfcore.optics.slab import Slab
from lfcore.oracle import colour as truth
from lfcore.storage.codecs import Encoding
from lfcore.storage.defaults import frame_layout
from lfcore.storage.layout import FrameLayout
from lfcore.storage.pixels import PIXEL_FORMATS
from lfcore.storage.segment import SegmentWriter
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.chunks import grid_corner
from lfcore.tracing.tracer import Tracer

pytestmark = pytest.mark.kernels

MADE = {"macropixels": bundles.macropixels, "views": bundles.views}
# (kind, views, pixels, pack): inner grids that are odd, smaller and larger than a block, in frames
# with empty slots, and with a margin around all.
LAYOUTS = [
    ("macropixels", 33, 6, 4), ("views", 3, 37, 2), ("views", 4, 5, 2),
    ("macropixels", 18, (5, 8), 4), ("views", 3, (37, 20), 2),
]  # fmt: skip


def painted_wall():
    """A wall of all colours without an edge: neighbours share those of their corners.

    Rays that differ in their last bits differ no more than that in colour.
    """
    y, x = np.mgrid[-4:5, -4:5]
    corners = np.stack([x, y, np.ones_like(x)], -1) * [0.1, 0.1, 1.6]
    colours = np.random.default_rng(4).random((9, 9, 3)) ** 3
    white = (1.2, 1.2, 1.2)
    return scene(mesh(corners), colours=mesh(colours), ambient=white, background=(0, 0, 0))


@pytest.fixture(scope="module")
def tracers():
    """One tracer each of one lane and of the device's own."""
    world = painted_wall()
    bvh = build_bvh(world.triangles)
    return {lanes: Tracer(world, bvh, open_device(threads=2, lanes=lanes)) for lanes in (1, None)}


def traced(tracer, layout):
    """(F, frame_bytes) uint8: all frames of the layout."""
    slab = Slab.of(CAMERA, layout.views, layout.size)
    tile = layout.tile(0, 0, *layout.outer)
    return np.concatenate([chunk.frames.copy() for chunk in tracer.trace_tile(slab, tile)])


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
    frames = traced(tracers[None], layout)
    planes = layout.format.views(frames, layout.frame_width, layout.frame_height)
    # Half a code of rounding, and the error of the encoding.
    limit = {8: 0.6, 10: 0.52, 12: 0.55}[layout.format.bits]
    for found, expected in zip(planes, expected_planes(tracers[None], layout), strict=True):
        assert np.abs(found - expected).max() < limit
        assert np.unique(found).size > 10


@pytest.mark.parametrize("name", ["gbrp", "yuv420p10le", "yuv444p"])  # each branch of frames.cl
def test_one_lane_gives_the_same_codes(tracers, name):
    layout = FrameLayout("views", 3, 37, "raster", 2, name)
    narrow, wide = (traced(tracer, layout) for tracer in tracers.values())
    np.testing.assert_array_equal(narrow, wide)


@pytest.mark.parametrize("name", ["gbrp", "yuv444p10le"])
def test_a_lossless_codec_gives_the_codes_back(tracers, tmp_path, name):
    layout = FrameLayout("views", 3, 37, pixel_format=name)
    frames, spec = traced(tracers[None], layout), Encoding("ffv1", name, preset=None, tune=None)
    with SegmentWriter(tmp_path / "0.mp4", spec, layout.frame_width, layout.frame_height) as out:
        out.write(frames)
    np.testing.assert_array_equal(segment_frames(tmp_path / "0.mp4"), frames)
