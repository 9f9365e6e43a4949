"""Shift-sum against equation 6.1 in float64, also of wide grids, and the fast focal stack."""

import itertools
from dataclasses import replace

import av
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_scenes import CHART, refused
from scattered_planes import form_plane
from scipy.ndimage import map_coordinates
from stored_fields import tile_frames, write_field

from lfcore import Camera, Extent, LightField, SensorPlane, Slab, open_device
from lfcore.cli import main
from lfcore.colour import srgb_decode, srgb_encode
from lfcore.evaluation.metrics import psnr
from lfcore.optics.array import thin_lens
from lfcore.optics.camera import image_distance
from lfcore.optics.planes import SHAPES
from lfcore.refocus.focal_stack import FocalStackSummer, focal_stack, focal_stack_views, plan
from lfcore.refocus.resampling import coverage
from lfcore.refocus.shift_sum import ViewSummer, shift_sum, shift_sum_views, to_fixed
from lfcore.refocus.slicing import form_planes
from lfcore.refocus.stored_views import read_stored, read_views
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


def by_equation_6_1(slab, views, plane, filter):
    """One picture (M, M, 3) float64, in metres.

    The ray of lens point U that arrives at x' on the sensor at v' = alpha v crosses the recorded
    one at ``U + (x' - U) / alpha``.  Pictures stand on their head on a sensor, so a tangent tau is
    at ``-tau v``.
    """
    size, recorded = slab.pixels, slab.camera.image_distance_m
    alpha = image_distance(slab.camera.focal_length_m, plane.focus_m) / recorded
    grid = slab.pixel_tangents() * (1.0 if plane.keep_magnification else alpha)
    total = np.zeros((4, size, size))
    for sample in np.argwhere(plane.mask(slab)):
        lens = slab.lens_positions()[sample][:, None]  # rows first
        place = (lens + (grid * recorded + lens) / -alpha) / (-slab.pixel_pitch * recorded)
        place += (size - 1) / 2
        if filter == "nearest":  # of two equally near the smaller, as slicing
            place = np.ceil(np.round(place, 9) - 0.5)
        at = np.meshgrid(*place, indexing="ij")
        layers = (*np.moveaxis(views[tuple(sample)], -1, 0).astype(float), np.ones((size, size)))
        total += [map_coordinates(one, at, order=1, mode="grid-constant") for one in layers]
    picture, weight = np.moveaxis(total[:3], 0, -1), total[3]
    if plane.normalise == "lens":
        zoom = alpha if plane.keep_magnification else 1.0
        return picture / (slab.views * zoom) ** 2
    return picture / np.where(weight > 1e-9, weight, np.inf)[..., None]


@pytest.mark.parametrize("filter", ["nearest", "bilinear"])
def test_planes_equal_the_reference(device, filter):
    slab = Slab(CAMERA, 5, 20)
    views = random_views(slab)
    got = shift_sum_views(slab, views, PLANES, filter=filter, device=device)
    for picture, plane in zip(got, PLANES, strict=True):
        expected = by_equation_6_1(slab, views, plane, filter)
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
            part = device.buffer(to_fixed(views.reshape(9, 16, 16, 3)[:, v0:v1, u0:u1]))
            summer.add_fixed(part, samples, (u0, v0, u1 - u0, v1 - v0))
        np.testing.assert_allclose(summer.pictures(), whole, atol=2e-4)


def test_a_pinhole_is_one_view_and_codes_are_srgb(device):
    slab = Slab(CAMERA, 5, 8)
    codes = np.random.default_rng(3).integers(0, 256, (5, 5, 8, 8, 3), np.uint8)
    picture = shift_sum_views(slab, codes, [SensorPlane(0.5, 1e5)], device=device)[0]
    np.testing.assert_allclose(picture, srgb_decode(codes[2, 2]), atol=1e-6)


def store(path, kind, pack=1):
    """Random views written losslessly, as (slab, codes of views, file)."""
    slab = Slab(CAMERA, 6, 18)
    codes = np.random.default_rng(5).integers(0, 256, (6, 6, 18, 18, 3), np.uint8)
    layout = FrameLayout(kind, slab.views, slab.pixels, pack=pack, pixel_format="gbrp")
    write_field(path, slab, layout, lambda tile: tile_frames(codes, tile))
    return slab, codes, path


@pytest.mark.parametrize(("kind", "pack"), [("views", 1), ("macropixels", 1), ("macropixels", 4)])
def test_stored_fields_equal_slicing_and_memory(tmp_path, kind, pack):
    slab, views, path = store(tmp_path / "lightfield.mkv", kind, pack)
    seen = []
    chosen = [p for p in PLANES if not p.keep_magnification]
    field = LightField.open(path)
    got = shift_sum(field, chosen, progress=lambda done, total: seen.append((done, total)))
    assert seen[-1][0] == seen[-1][1] > 0
    np.testing.assert_allclose(got, shift_sum_views(slab, views, chosen), atol=2e-6)
    np.testing.assert_allclose(got, form_planes(field, chosen).sums.pictures(), atol=2e-6)
    smooth = shift_sum(field, PLANES, filter="bilinear")
    in_memory = shift_sum_views(slab, views, PLANES, filter="bilinear")
    np.testing.assert_allclose(smooth, in_memory, atol=3e-4)


@pytest.mark.parametrize("kind", ["views", "macropixels"])
def test_salvage_costs_a_damaged_segment_its_own_rays_only(tmp_path, kind):
    slab, views, path = store(tmp_path / "lightfield.mkv", kind)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 255
    path.write_bytes(data)
    plane = SensorPlane(3.0, 2.0, "square")
    refused("check sum", LightField.open(path).refocus)
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
    refused("unknown filter 'cubist'", shift_sum_views, slab, views, PLANES, filter="cubist")
    refused("wider than the lens", shift_sum_views, slab, views, [SensorPlane(3.0, 1.0)])
    refused("views: must be", shift_sum_views, slab, views[:2], PLANES)
    refused("no such file", LightField.open, tmp_path / "none.mkv")


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


COLUMNS, ROWS, WIDTH, HEIGHT = 5, 3, 22, 16
EXTENT = Extent.centred(COLUMNS, ROWS, WIDTH, HEIGHT)
SLAB = Slab(thin_lens(1.0, 2.5, 1.0), 5, 22, EXTENT)  # lens pitch 1 m, focus 1 m


PICTURES = np.random.default_rng(3).integers(0, 256, (ROWS, COLUMNS, HEIGHT, WIDTH, 3), np.uint8)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    file = tmp_path_factory.mktemp("partial") / "lf.mkv"
    layout = FrameLayout("views", 5, 22, pixel_format="gbrp")
    column, row, *_ = EXTENT.views
    left, top, *_ = EXTENT.pixels
    square = np.zeros((5, 5, 22, 22, 3), np.uint8)
    square[row:, column:, top:, left:][:ROWS, :COLUMNS, :HEIGHT, :WIDTH] = PICTURES
    write_field(
        file, SLAB, layout, lambda tile: tile_frames(square, tile),
        tiles=[layout.tile(column, row, COLUMNS, ROWS)], content={"metric": False},
    )  # fmt: skip
    return file


def naive(disparity, views=np.inf):
    """Every view shifted by whole pixels and averaged where it has a pixel, one at a time."""
    total, count = np.zeros((HEIGHT, WIDTH, 3)), np.zeros((HEIGHT, WIDTH, 1))
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    for j, i in np.ndindex(ROWS, COLUMNS):
        s, t = i + EXTENT.views[0] - 2, j + EXTENT.views[1] - 2
        if np.hypot(s, t) <= views / 2:
            u, v = (x - int(np.floor(s * disparity + 0.5)), y - int(np.floor(t * disparity + 0.5)))
            there = (u >= 0) & (u < WIDTH) & (v >= 0) & (v < HEIGHT)
            total[there] += srgb_decode(PICTURES[j, i])[v[there], u[there]]
            count[there] += 1
    return total / np.maximum(count, 1)


def test_views_and_pixels_count_from_the_first_there_is(path, device):
    field = LightField.open(path)
    assert (field.grid, field.picture_size) == ((COLUMNS, ROWS), (WIDTH, HEIGHT))
    for j, i in ((0, 0), (2, 4), (1, 3)):
        np.testing.assert_array_equal(field.view(i, j, codes=True), PICTURES[j, i])
    np.testing.assert_array_equal(field.macropixel(21, 15, codes=True), PICTURES[:, :, 15, 21])
    np.testing.assert_array_equal(field.views(1, 0, 3, 3, codes=True), PICTURES[0:3, 1:3])
    refused("columns are 0 to 4, rows 0 to 2", field.view, 0, 3, codes=True)
    light = read_views(field, np.array([[4, 2], [0, 0]]), device=device)
    np.testing.assert_allclose(light[0], srgb_decode(PICTURES[2, 4]), atol=4e-6)
    refused(r"\(4, 2\)", read_views, field, np.array([[0, 3]]), device=device)


def test_refocused_stopped_down_by_views_and_stacked_fast(path):
    field = LightField.open(path)
    for disparity in (0.0, 2.0, -1.4):
        picture = field.refocus(disparity_px=disparity, aperture="square")
        np.testing.assert_allclose(picture, naive(disparity), atol=4e-6)
    dimmed = field.plane(disparity_px=0.0, aperture="square", normalise="lens")
    np.testing.assert_allclose(field.refocus_many([dimmed])[0], naive(0.0), atol=4e-6)
    planes = [field.plane(disparity_px=d, aperture_views=3) for d in (0.0, 1.0)]
    for picture, disparity in zip(field.refocus_many(planes), (0.0, 1.0), strict=True):
        np.testing.assert_allclose(picture, naive(disparity, 3), atol=4e-6)
    stack = focal_stack(field, planes, tolerance_px=1e-6)
    np.testing.assert_allclose(stack[0], naive(0.0, 3), atol=4e-6)


def test_what_needs_a_geometry_is_refused(path):
    field = LightField.open(path)
    refused("has no camera geometry", field.refocus, focus_m=2.0)
    refused("has no camera geometry", field.refocus, f_number=2.0)
    refused("the -22 of infinity", field.refocus, disparity_px=-23)
    assert field.disparity_of(field.distance_of(0.25)) == pytest.approx(0.25)
    same = shift_sum(field, [field.plane()])
    np.testing.assert_array_equal(form_planes(field, [field.plane()]).sums.pictures(), same)


def test_as_a_camera_array(path):
    field = LightField.open(path)
    refused("camera array needs", read_stored, field)
    field.metadata.content.clear()  # as if its metres were the cameras'
    image, array = read_stored(field)
    assert (array.cameras, array.tile) == ((COLUMNS, ROWS), (WIDTH, HEIGHT))
    assert array.pixel_pitch == pytest.approx(SLAB.pixel_pitch)
    light = array.tiles(image)
    np.testing.assert_allclose(light[1, 3], srgb_decode(PICTURES[1, 3]), atol=4e-6)


def test_extents():
    refused(r"extent\.views", Slab, SLAB.camera, 5, 22, Extent((0, 3, 5, 3), (0, 0, 22, 22)))
    assert Slab.from_json(SLAB.to_json()) == SLAB
    assert Extent.centred(1, 1, 3, 3) == Extent((0, 0, 1, 1), (0, 0, 3, 3))


WIDE_LENS = Camera(0.2, 0.1, 1.0, 2.0)  # wide: shifts of many pixels


def stack(count, near=1.2, far=6.0, **changes):
    dioptres = np.linspace(1 / near, 1 / far, count)
    return [SensorPlane(float(1 / delta), WIDE_LENS.f_number, **changes) for delta in dioptres]


@pytest.fixture(scope="module")
def slab():
    return Slab(WIDE_LENS, 16, 96)


@pytest.fixture(scope="module")
def views(slab):
    """Views of two textured layers, one before and one behind the recorded focus."""
    s, x = slab.lens_positions(), slab.pixel_tangents()
    views = np.empty((slab.views, slab.views, slab.pixels, slab.pixels, 3), np.float32)
    for j, i in np.ndindex(slab.views, slab.views):
        for depth, far in ((4.0, True), (1.5, False)):
            # Where the ray of each pixel meets the layer, metres.
            across = (s[i] * (1 - depth * WIDE_LENS.delta) + depth * x)[None, :]
            down = (s[j] * (1 - depth * WIDE_LENS.delta) + depth * x)[:, None]
            wave = 0.5 + 0.4 * np.sin(25 * across) * np.cos(31 * down)
            colour = np.stack([wave, 0.7 * wave + 0.1, 1 - wave], -1)
            seen = np.broadcast_to(far | (np.abs(across) < 0.15), wave.shape)
            views[j, i][seen] = colour[seen]
    return views


def inside(slab, plane):
    """Where a pixel has all views."""
    return coverage(slab, plane, "bilinear") > plane.mask(slab).sum() * (1 - 1e-6)


def test_error_against_the_exact_stack(slab, views):
    """On sRGB codes: some 50 dB and more where every pixel has all views, 38 dB at the border."""
    planes = stack(40)
    fast = focal_stack_views(slab, views, planes)
    exact = shift_sum_views(slab, views, planes)
    found = []
    for plane, ours, theirs in zip(planes, fast, exact, strict=True):
        whole = inside(slab, plane)
        codes = [255 * srgb_encode(np.clip(p[whole], 0, 1)) for p in (ours, theirs)]
        found.append(psnr(*codes, peak=255))
    assert np.mean(found) > 48, f"{np.mean(found):.1f} dB"
    assert min(found) > 33, f"{min(found):.1f} dB"
    # At the border too there is nothing odd: no pixel is off by much on average.
    assert np.abs(fast - exact).mean() < 0.01


def test_a_hundred_planes_cost_less_than_a_fifth_of_a_hundred_passes(slab):
    planes = stack(100)
    additions = plan(slab, planes, 0.5).additions
    assert additions < len(planes) * planes[0].mask(slab).sum() / 5
    assert additions < 1.9 * plan(slab, stack(50), 0.5).additions


@given(st.integers(1, 7), st.integers(4, 20), st.floats(1.2, 1.9), st.floats(2.1, 9.0))
@settings(max_examples=20)
def test_constant_light_stays_constant(views, pixels, near, far):
    slab = Slab(WIDE_LENS, views, pixels)
    planes = stack(5, near, far)
    light = np.full((views, views, pixels, pixels, 3), 0.5, np.float32)
    fast = focal_stack_views(slab, light, planes)
    for plane, picture in zip(planes, fast, strict=True):
        np.testing.assert_allclose(picture[inside(slab, plane)], 0.5, atol=2e-3)


def test_the_recorded_focus_alone_is_exact(slab, views):
    plane = SensorPlane(2.0, 1.4, "square", normalise="lens")
    fast = focal_stack_views(slab, views, [plane])
    np.testing.assert_allclose(fast, shift_sum_views(slab, views, [plane]), atol=2e-5)


def test_stacks_that_cannot_be_are_refused(slab):
    planes = stack(3)
    refused("one aperture", FocalStackSummer, slab, [planes[0], replace(planes[1], f_number=8.0)])
    refused("magnification", FocalStackSummer, slab, stack(2, keep_magnification=True))
    refused("no planes", FocalStackSummer, slab, [])
    refused("tolerance_px", FocalStackSummer, slab, planes, tolerance_px=0)


@pytest.mark.parametrize("kind", ["macropixels", "views"])
def test_from_a_file(tmp_path, kind):
    path = tmp_path / "chart.mkv"
    options = f"--depth none --pixels 96 --views 4 --codec ffv1,layout={kind}".split()
    assert main(["record", str(CHART), "-o", str(path), *options]) == 0
    planes = [SensorPlane(d, 1.0) for d in (1.0, 1.33, 2.0)]
    field = LightField.open(path)
    fast, exact = focal_stack(field, planes), shift_sum(field, planes)
    assert np.abs(fast - exact).mean() < 0.02
    film = tmp_path / "film.mp4"
    options = "--focus 1 1.33 2 --method blocks".split()
    command = ["stack", str(path), *options, "-o", str(film)]
    assert main(command) == 0
    with av.open(str(film)) as container:
        frames = [
            frame.reformat(format="rgb24", src_colorspace="ITU709").to_ndarray()
            for frame in container.decode(video=0)
        ]
    off = np.abs(np.stack(frames)[:, None] / 255.0 - srgb_encode(fast)).mean((2, 3, 4))
    assert off.shape == (3, 3) and (off.argmin(1) == [0, 1, 2]).all()
    film.unlink()
    assert main([*command, "--filter", "bilinear"]) == 1
    assert not film.exists()
