"""Sensor planes of whole tiles, to the last bit the sum of every ray alone."""

from types import SimpleNamespace

import numpy as np
import pytest
from tracing_scenes import CAMERA, closed_room, lit_soup, painted_soup, scene, traced, tracer_of

from lfcore.errors import DeviceError
from lfcore.opencl.device import open_device
from lfcore.optics import bundles
from lfcore.optics.plane_sums import FIXED_ONE, targets
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.oracle.slab import all_pixels
from lfcore.storage.layout import FrameLayout
from lfcore.tracing import plane_buffers
from lfcore.tracing.plane_buffers import strip_rows, workers_that_fit

pytestmark = pytest.mark.kernels

# Every ray on its own pixel, several on one, most beside the picture, pixels moved unevenly, fewer
# pixels than the slab's.
PLANES = [
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
# Beams of 4 x 4, 2 x 2 and single pixels; lens grids that fill their blocks and that do not;
# lit, which is slow to build, in beams of one block an element and of several.
SIZES = [
    (3, 13, painted_soup), (16, 11, lit_soup), (16, 12, lit_soup), (20, 9, painted_soup),
    (40, 5, lit_soup), (70, 4, painted_soup),
]  # fmt: skip


def fixed_point(colours):
    """Whole numbers of 2^-20, as the kernels round: once to float32 after adding a half."""
    clamped = np.clip(colours, 0, 1).astype(np.float64)
    return (clamped * FIXED_ONE + 0.5).astype(np.float32).astype(np.uint64)


def scattered(slab, plane, rays):
    """(3, M, M) uint64: every ray of (M, M, N, N, 3), indexed [v, u, j, i], added alone."""
    sums = np.zeros((slab.pixels, slab.pixels, 3), np.uint64)
    where, mask = targets(slab, plane), plane.mask(slab)
    v, u, j, i = np.nonzero(np.broadcast_to(mask, rays.shape[:4]))
    x, y = where[u, i], where[v, j]
    inside = (x >= 0) & (x < slab.pixels) & (y >= 0) & (y < slab.pixels)
    kept = tuple(index[inside] for index in (v, u, j, i))
    np.add.at(sums, (y[inside], x[inside]), rays[kept])
    return np.moveaxis(sums, -1, 0)


def formed(tracer, layout, planes=PLANES, **how):
    return traced(tracer, layout, planes, **({"frames": False} | how))[1].sums


@pytest.mark.parametrize(
    "views, pixels, make, lanes", [(*size, None) for size in SIZES] + [(16, 11, painted_soup, 1)]
)
def test_sums_are_every_ray_alone(views, pixels, make, lanes, monkeypatch):
    tracer = tracer_of(make(), open_device(threads=1, lanes=lanes))
    slab = Slab(CAMERA, views, pixels)
    places = all_pixels(slab)
    colours = tracer.bundle_radiance(bundles.macropixels(slab, places), places)
    rays = fixed_point(colours).reshape(pixels, pixels, views, views, 3)
    layout = FrameLayout("macropixels", views, pixels, "serpentine", 1, "yuv444p")
    sums = formed(tracer, layout)
    for plane, found in zip(PLANES, sums, strict=True):
        np.testing.assert_array_equal(found, scattered(slab, plane, rays), str(plane))
    # Tiles that begin and end amid a beam.
    for most in (2, 2 * pixels):
        np.testing.assert_array_equal(formed(tracer, layout, max_rays=most * views**2), sums)
    # Strips of several beams, even in a picture this small.
    monkeypatch.setattr(plane_buffers, "ITEMS_A_WORKER", 1)
    np.testing.assert_array_equal(formed(tracer, layout), sums)


@pytest.mark.parametrize("views, pixels", [(16, 40), (64, 17), (200, 9), (1024, 1)])
def test_no_sum_of_white_rays_overflows(views, pixels, monkeypatch):
    """A beam of white rays on one pixel is 2^32."""
    monkeypatch.setattr(plane_buffers, "ITEMS_A_WORKER", 1)
    white_room = scene(closed_room(1), background=(1, 1, 1), ambient=(9, 9, 9))
    tracer = tracer_of(white_room, open_device(threads=1))
    planes = [SensorPlane(CAMERA.focus_m, CAMERA.f_number, aperture="square")]
    sums = formed(tracer, FrameLayout("macropixels", views, pixels), planes)
    assert (sums == views**2 * FIXED_ONE).all()


@pytest.mark.parametrize("pixels, span", [(4, 16), (12, 32), (32, 16)])
@pytest.mark.parametrize("views, size", [(5, 16), (16, 27), (33, 8)])
def test_strip_rows_by_walking_strips(pixels, span, views, size):
    slab = Slab(CAMERA, views, size)
    most = 0
    for plane in PLANES:
        where = targets(slab, plane)
        for v in range(0, size, pixels):
            for j in range(0, views, span):
                part = where[v : v + pixels, j : j + span]
                most = max(most, int(part.max() - part.min()) + 1)
    found = strip_rows(slab, PLANES, pixels, span)
    # Rows of pixels beside the picture may add to it, but no more than there are of them.
    assert most <= found <= most + pixels


def test_workers_are_as_many_as_memory_has_sums_for():
    about = SimpleNamespace(max_mem_alloc_size=20 << 30, global_mem_size=64 << 30)
    wide = SimpleNamespace(threads=64 * 132, device=about, name="a wide one")
    assert workers_that_fit(wide, 1 << 10) == wide.threads
    assert workers_that_fit(wide, 42 << 20) == (16 << 30) // (42 << 20)
    with pytest.raises(DeviceError, match=r"17\.0 GiB, and a wide one has room for 16\.0.*fewer"):
        workers_that_fit(wide, 17 << 30)


def test_fewer_workers_give_the_same_sums(monkeypatch):
    layout = FrameLayout("macropixels", 3, 13)
    tracer = tracer_of(painted_soup(), open_device(threads=2))
    many = formed(tracer, layout)
    monkeypatch.setattr(plane_buffers, "workers_that_fit", lambda device, each: 1)
    assert (formed(tracer, layout) == many).all()
