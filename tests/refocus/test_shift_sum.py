"""Shift-sum on views against equation 6.1 in float64, against scattering, and against slicing."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stored_fields import tile_frames, write_field

from lfcore.errors import OpticsError, StorageError
from lfcore.lightfield import LightField
from lfcore.opencl.device import open_device
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SHAPES, SensorPlane
from lfcore.optics.slab import Slab
from lfcore.oracle.colour import srgb_decode
from lfcore.oracle.planes import form_plane
from lfcore.refocus.shift_sum import ViewSummer, shift_sum, shift_sum_views
from lfcore.refocus.shift_sum_reference import shift_sum_reference
from lfcore.refocus.slicing import form_planes
from lfcore.storage.layout import FrameLayout

CAMERA = Camera(0.05, 0.036, 2.0, 3.0)
PLANES = [
    SensorPlane(1.01, 2.0, "square"),
    SensorPlane(3.0, 2.9, "circle", normalise="lens"),
    SensorPlane(9.7, 2.3, "polygon", blades=5, rotation_deg=10),
    SensorPlane(0.71, 2.0, "diamond", keep_magnification=True),
    SensorPlane(0.63, 50.0, keep_magnification=True, normalise="lens"),
]


def random_views(slab, seed=0):
    generator = np.random.default_rng(seed)
    shape = (slab.views, slab.views, slab.pixels, slab.pixels, 3)
    return generator.random(shape, np.float32)


@pytest.mark.parametrize("filter", ["nearest", "bilinear"])
def test_planes_equal_the_reference(device, filter):
    slab = Slab(CAMERA, 5, 20)
    views = random_views(slab)
    got = shift_sum_views(slab, views, PLANES, filter=filter, device=device)
    for picture, plane in zip(got, PLANES, strict=True):
        expected = shift_sum_reference(slab, views, plane, filter)
        # Pixels at the border that hold little more than no light are held in few bits.
        assert np.median(np.abs(picture - expected)) < 2e-6
        np.testing.assert_allclose(picture, expected, atol=2e-4)


planes = st.builds(
    SensorPlane,
    focus_m=st.floats(0.5, 50),
    f_number=st.floats(2.0, 20.0),
    aperture=st.sampled_from(SHAPES),
    normalise=st.sampled_from(["aperture", "lens"]),
)


@given(planes, st.integers(1, 6), st.integers(2, 24))
@settings(max_examples=30)
def test_with_one_filter_shift_sum_is_scattering(device, plane, views, pixels):
    """Gathering views and scattering rays agree to rounding, nearest and bilinear."""
    slab = Slab(CAMERA, views, pixels)
    light = random_views(slab, views)
    rays = light.transpose(2, 3, 0, 1, 4)
    nearest = shift_sum_views(slab, light, [plane], device=device)[0]
    np.testing.assert_allclose(nearest, form_plane(slab, plane, rays), atol=2e-6)
    bilinear = shift_sum_views(slab, light, [plane], filter="bilinear", device=device)[0]
    scattered = form_plane(slab, plane, rays, bilinear=True)
    assert np.median(np.abs(bilinear - scattered)) < 2e-6


def test_rectangles_of_views_add_up(device):
    slab = Slab(CAMERA, 3, 16)
    views = random_views(slab)
    samples = np.argwhere(np.ones((3, 3)))[:, ::-1]
    for filter in ("nearest", "bilinear"):
        whole = shift_sum_views(slab, views, PLANES, filter=filter, device=device)
        summer = ViewSummer(slab, PLANES, filter=filter, device=device)
        for (u0, u1), (v0, v1) in itertools.product([(0, 5), (5, 16)], [(0, 9), (9, 16)]):
            part = views.reshape(9, 16, 16, 3)[:, v0:v1, u0:u1]
            summer.add(part, samples, (u0, v0))
        np.testing.assert_allclose(summer.pictures(), whole, atol=2e-4)


def test_a_pinhole_is_one_view_and_codes_are_srgb(device):
    slab = Slab(CAMERA, 5, 8)
    codes = np.random.default_rng(3).integers(0, 256, (5, 5, 8, 8, 3), np.uint8)
    picture = shift_sum_views(slab, codes, [SensorPlane(0.5, 1e5)], device=device)[0]
    np.testing.assert_allclose(picture, srgb_decode(codes[2, 2] / 255.0), atol=1e-6)


def store(path, slab, views, kind, pack=1):
    """Views (linear) written losslessly as a light field file."""
    layout = FrameLayout(kind, slab.views, slab.pixels, pack=pack, pixel_format="gbrp")
    write_field(path, slab, layout, lambda tile: tile_frames(views, tile))
    return path


@pytest.mark.parametrize(("kind", "pack"), [("views", 1), ("macropixels", 1), ("macropixels", 4)])
def test_stored_fields_equal_slicing_and_memory(tmp_path, kind, pack):
    slab = Slab(CAMERA, 6, 18)
    views = np.random.default_rng(5).integers(0, 256, (6, 6, 18, 18, 3), np.uint8)
    path = store(tmp_path / "lightfield.mkv", slab, views, kind, pack)
    seen = []
    chosen = [p for p in PLANES if not p.keep_magnification]
    got = shift_sum(path, chosen, progress=lambda done, total: seen.append((done, total)))
    assert seen[-1][0] == seen[-1][1] > 0
    np.testing.assert_allclose(got, shift_sum_views(slab, views, chosen), atol=2e-6)
    sliced = form_planes(path, chosen).sums.pictures()
    np.testing.assert_allclose(got, sliced, atol=2e-6)
    smooth = shift_sum(path, PLANES, filter="bilinear")
    in_memory = shift_sum_views(slab, views, PLANES, filter="bilinear")
    np.testing.assert_allclose(smooth, in_memory, atol=3e-4)


@pytest.mark.parametrize("kind", ["views", "macropixels"])
def test_salvage_costs_a_damaged_segment_its_own_rays_only(tmp_path, kind):
    slab = Slab(CAMERA, 6, 18)
    views = np.random.default_rng(5).integers(0, 256, (6, 6, 18, 18, 3), np.uint8)
    path = store(tmp_path / "lightfield.mkv", slab, views, kind)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 255
    path.write_bytes(data)
    plane = SensorPlane(3.0, 2.0, "square")
    with pytest.raises(StorageError, match="check sum"):
        LightField.open(path).refocus()
    field = LightField.open(path, salvage=True)
    assert len(field.damage) == 1
    lost = np.zeros((6, 6, 18, 18), bool)
    for column, row in field.damage[0].segment.tile.elements():
        if kind == "views":
            lost[row, column] = True
        else:
            lost[:, :, row, column] = True
    expected = shift_sum_views(slab, np.where(lost[..., None], 0, views), [plane])
    np.testing.assert_allclose(field.refocus_many([plane]), expected, atol=3e-6)
    summed = field.refocus_many([plane], method="shift-sum")
    np.testing.assert_allclose(summed, expected, atol=3e-6)


def test_bad_input_is_refused(tmp_path):
    slab = Slab(CAMERA, 3, 8)
    views = random_views(slab)
    with pytest.raises(OpticsError, match="unknown filter 'cubist'"):
        shift_sum_views(slab, views, PLANES, filter="cubist")
    with pytest.raises(OpticsError, match="wider than the lens"):
        shift_sum_views(slab, views, [SensorPlane(3.0, 1.0)])
    with pytest.raises(OpticsError, match="views are"):
        shift_sum_views(slab, views[:2], PLANES)
    with pytest.raises(StorageError, match="No such file"):
        shift_sum(tmp_path / "none.mkv", PLANES)


@pytest.mark.kernels
@pytest.mark.parametrize("lanes", [1, 4, 8, 16])
def test_every_lane_width_gives_the_same_bits(device, lanes):
    slab = Slab(CAMERA, 3, 21)
    views = random_views(slab)
    other = open_device(device.name, lanes=lanes)
    for filter in ("nearest", "bilinear"):
        got = shift_sum_views(slab, views, PLANES, filter=filter, device=other)
        want = shift_sum_views(slab, views, PLANES, filter=filter, device=device)
        np.testing.assert_array_equal(got, want)
