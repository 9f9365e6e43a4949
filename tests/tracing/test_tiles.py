"""Tiles: colours against the oracle, exact sums, frames, and independence of how work is cut."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tracing_scenes import CAMERA, closed_room, crowd, lit_soup, scene, traced, tracer_of

from lfcore.opencl.device import open_device
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.oracle import colour as truth
from lfcore.oracle.planes import form_plane
from lfcore.oracle.slab import all_pixels, trace
from lfcore.storage.defaults import frame_layout
from lfcore.storage.layout import FrameLayout
from lfcore.storage.ycbcr import rgb_to_ycbcr

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
        tracing = tracer.trace_tile(slab, layout.tile(*at, width, height), PLANES)
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
        (lit_soup, {}), (lit_soup, {"outer": 2}), (lit_soup, {"outer": 4}),
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


def test_a_uniform_room_is_uniform_in_every_plane(device):
    tracer = tracer_of(scene(closed_room(), background=(0, 0, 0)), device)
    layout = FrameLayout("macropixels", 33, 20, pixel_format="yuv420p")
    frames, sums = traced(tracer, layout, PLANES)
    for picture, plane in zip(sums.pictures(), PLANES, strict=True):
        if plane.normalise == "aperture":
            expected = np.float32([0.1, 0.2, 0.3])
            reached = picture.any(axis=2)
            assert reached.mean() > 0.6
            assert np.abs(picture[reached] - expected).max() < 2.0**-19
    luma, blue, red = layout.format.views(frames, layout.frame_width, layout.frame_height)
    code = np.rint(rgb_to_ycbcr(truth.srgb_encode(np.array([0.1, 0.2, 0.3]))))
    assert (luma[:, :33, :33] == code[0]).all()
    assert (blue[:, :16, :16] == code[1]).all() and (red[:, :16, :16] == code[2]).all()
