"""The thin lens, the slab, cells of rays, apertures, sensor planes, targets, counts and exact sums,
against values worked out by hand."""

import math
from dataclasses import replace
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from plain_scenes import refused
from scattered_planes import form_plane, scattered_sums

from lfcore import Aperture, Camera, SensorPlane, Slab
from lfcore.optics import bundles
from lfcore.optics.camera import check_focus, image_distance
from lfcore.optics.plane_sums import FIXED_ONE, PlaneSums, ray_counts, targets, total
from lfcore.optics.planes import SHAPES
from lfcore.optics.ray_cells import displaced_views, lens_cells, plain_views
from lfcore.oracle.slab import all_pixels, slab_rays


def test_image_distance_by_hand():
    # f = 50 mm focused at 1 m: v = 0.05 / (1 - 0.05) = 1 / 19 m
    camera = Camera(0.05, 0.036, 2.0, 1.0)
    assert camera.image_distance_m == pytest.approx(1 / 19, rel=1e-15)
    assert camera.field_width == pytest.approx(0.036 * 19, rel=1e-15)
    assert camera.lens_radius_m == pytest.approx(0.0125) and camera.delta == 1.0
    far = replace(camera, focus_m=math.inf)
    assert (far.delta, far.image_distance_m) == (0, 0.05)
    # radius 12.5 mm, 4 samples: centres of 6.25 mm cells
    slab = Slab(far, 4, 2)
    np.testing.assert_allclose(slab.lens_positions() * 1e3, [-9.375, -3.125, 3.125, 9.375])
    np.testing.assert_allclose(slab.pixel_tangents(), [-0.18, 0.18])
    assert slab.rays == 64 and slab.pixel_pitch == pytest.approx(0.36)


def camera(**changes):
    good = {"focal_length_m": 0.05, "sensor_width_m": 0.036, "f_number": 2.0, "focus_m": 3.0}
    return Camera(**(good | changes))


def test_what_cannot_be_is_refused():
    for key, value in (
        ("focal_length_m", 0.0), ("sensor_width_m", -1.0), ("f_number", math.nan),
        ("f_number", math.inf), ("focus_m", 0.05), ("focus_m", math.nan),
    ):  # fmt: skip
        refused(key, camera, **{key: value})
    inside = "where: .*inside the focal length.*Focus farther"
    refused(inside, check_focus, 0.03, 0.05, key="where")
    for size in ((0, 4), (4, 0), (2.0, 4), (4, -1), (5000, 4), (4, 70000)):
        refused("views|pixels", Slab, camera(), *size)
    refused("unknown aperture 'heart'", Aperture, "heart", 1.0)
    refused("blades: ", Aperture, "polygon", 1.0, blades=2)
    refused("unknown normalisation 'sum'", SensorPlane, 3.0, 2.0, normalise="sum")
    slab = Slab(camera(), 4, 4)
    refused(r"f/1.4 is wider than the lens, f/2\.", SensorPlane(3.0, 1.4).check, slab)
    refused("focus_m", SensorPlane(0.05, 2.0).check, slab)


@given(st.floats(1e-3, 1.0), st.floats(-12, 6))
def test_thin_lens_equation_holds(focal, exponent):
    """1/f = 1/v + 1/u, exactly but for three roundings, from just beyond the focal length on."""
    distance = focal * (1 + 10**exponent)
    f, u = Fraction(focal), Fraction(distance)
    assert image_distance(focal, distance) == pytest.approx(float(f * u / (u - f)), rel=4e-16 * 2)


@pytest.mark.parametrize("focus", [0.0501, 0.1, 1.0, 1e3, 1e8, 1e20, 1e38, math.inf])
@pytest.mark.parametrize("number", [1e-3, 1.0, 1e2, 1e8, 1e30])
def test_directions_are_rounded_three_times(focus, number):
    """From a lens of 50 m to a pinhole, whatever the focus: 4 units of 2^-24."""
    slab = Slab(Camera(0.05, 0.036, number, focus), 16, 64)
    pixels = np.array([[0, 63], [21, 42], [63, 0]])
    found = bundles.macropixels(slab, pixels).rays()[1].astype(float)
    s, x = slab.lens_positions() * slab.camera.delta, slab.pixel_tangents()[pixels]
    exact = np.ones(found.shape)
    exact[..., 0] = x[:, 0, None, None] - s
    exact[..., 1] = x[:, 1, None, None] - s[:, None]
    unit = [a / np.linalg.norm(a, axis=-1, keepdims=True) for a in (found, exact)]
    assert np.linalg.norm(np.cross(*unit), axis=-1).max() < 4 * 2.0**-24


@given(st.integers(1, 64), st.integers(1, 64))
def test_grids_are_centred_and_even(views, pixels):
    slab = Slab(Camera(0.05, 0.036, 1.4, 2.0), views, pixels)
    s, x = slab.lens_positions(), slab.pixel_tangents()
    np.testing.assert_allclose(s, -s[::-1], atol=1e-18)
    np.testing.assert_allclose(x, -x[::-1], atol=1e-18)
    np.testing.assert_allclose(np.diff(s), slab.lens_pitch_m, rtol=1e-9)
    np.testing.assert_allclose(np.diff(x), slab.pixel_pitch, rtol=1e-9)
    # The cells fill the lens and the field exactly.
    assert s[-1] + slab.lens_pitch_m / 2 == pytest.approx(slab.camera.lens_radius_m)
    assert x[-1] + slab.pixel_pitch / 2 == pytest.approx(slab.camera.field_width / 2)


slabs = st.builds(
    lambda number, focus, views, pixels: Slab(Camera(0.05, 0.036, number, focus), views, pixels),
    st.sampled_from([1.0, 2.8]),
    st.sampled_from([0.5, 3.0, math.inf]),
    st.integers(1, 6),
    st.integers(1, 6),
)


@given(slabs)
def test_macropixels_and_views_are_the_slab(slab):
    pixels = all_pixels(slab)
    origin, direction = bundles.macropixels(slab, pixels).rays()
    expected_origin, expected_direction = slab_rays(slab, pixels)
    np.testing.assert_allclose(origin, expected_origin, atol=1e-8)
    np.testing.assert_allclose(direction, expected_direction, atol=1e-6)
    n, m = slab.views, slab.pixels
    j, i = np.divmod(np.arange(n * n), n)
    origin, direction = bundles.views(slab, np.stack([i, j], 1)).rays()
    expected = [a.reshape(m, m, n, n, 3) for a in slab_rays(slab, all_pixels(slab))]
    for got, want in zip((origin, direction), expected, strict=True):
        got = got.reshape(n, n, m, m, 3).transpose(2, 3, 0, 1, 4)
        np.testing.assert_allclose(got, want, atol=1e-6)


CAMERA = Camera(0.4, 0.3, 1.0, 4.0)


@pytest.mark.parametrize("views", [1, 2, 3, 5, 8, 17])
def test_displacements_are_every_multiple_once_along_each_axis(views):
    moved = displaced_views(Slab(CAMERA, views, 8)).displacement
    expected = (np.arange(views**2) + 0.5) / views**2 - 0.5
    for axis in range(2):
        np.testing.assert_allclose(np.sort(moved[:, axis]), expected, atol=1e-12)


@pytest.mark.parametrize("views", [4, 8])
def test_a_row_of_views_has_all_places_to_within_its_number(views):
    along_u = displaced_views(Slab(CAMERA, views, 8)).displacement[:, 0].reshape(views, views)
    for line in along_u.T:  # the views of one lens column, row by row
        assert sorted(np.floor((line + 0.5) * views).astype(int)) == list(range(views))


def test_displaced_rays_lie_where_the_displacement_says():
    views = displaced_views(Slab(CAMERA, 3, 5))
    plain, moved = (each.bundles(slice(2, 7)) for each in (plain_views(views.slab), views))
    found = (moved.rays()[1] - plain.rays()[1])[..., :2] / views.slab.pixel_pitch
    expected = views.displacement[2:7, None, None]
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=1e-4)
    # Those that are not displaced are the slab's views.
    samples = np.array([[i, j] for j in range(3) for i in range(3)])[2:7]
    theirs = bundles.views(views.slab, samples)
    np.testing.assert_allclose(plain.elements, theirs.elements, atol=1e-9)
    np.testing.assert_array_equal(plain.step, theirs.step)


def test_the_whole_lens_opens_whole_cells():
    slab = Slab(CAMERA, 5, 4)
    cells = lens_cells(slab, Aperture("square", CAMERA.lens_radius_m))
    np.testing.assert_allclose(cells.share, 1)
    np.testing.assert_allclose(cells.middle, plain_views(slab).positions, atol=1e-12)
    np.testing.assert_allclose(cells.extent, slab.lens_pitch_m)


@pytest.mark.parametrize("f_number", [1.0, 2.3, 16.0, 4000.0])
@pytest.mark.parametrize("shape", SHAPES)
def test_open_cells_add_up_to_the_aperture(shape, f_number):
    slab = Slab(CAMERA, 6, 4)
    radius = CAMERA.focal_length_m / (2 * f_number)
    cells = lens_cells(slab, Aperture(shape, radius))
    area = {"circle": math.pi, "square": 4, "diamond": 2, "polygon": 3 * math.sin(math.pi / 3)}
    total = cells.share.sum() * slab.lens_pitch_m**2
    assert total == pytest.approx(area[shape] * radius**2, rel=0.01)
    assert (cells.share <= 1 + 1e-9).all()
    middle = (cells.share[:, None] * cells.middle).sum(0) / cells.share.sum()
    np.testing.assert_allclose(middle, 0, atol=0.01 * radius)


@given(st.floats(0.02, 0.2), st.sampled_from(SHAPES), st.integers(1, 9))
@example(0.19459579372252403, "polygon", 9)  # whose points stand for parts of two cells
@settings(max_examples=30)
def test_an_open_part_lies_in_its_cell(radius, shape, views):
    slab = Slab(CAMERA, views, 4)
    cells = lens_cells(slab, Aperture(shape, radius))
    is_open = cells.share > 0
    off = np.abs(cells.middle - plain_views(slab).positions)[is_open]
    assert is_open.any()
    assert (off <= slab.lens_pitch_m / 2 * (1 + 1e-9)).all()
    # The box of equal spread is at most the cell's, for two clumps at its ends sqrt(3) times it.
    assert (cells.extent[is_open] <= math.sqrt(3) * slab.lens_pitch_m * (1 + 1e-9)).all()


NARROW = Camera(0.05, 0.036, 2.0, 3.0)
planes = st.builds(
    SensorPlane,
    focus_m=st.floats(0.3, 100.0),
    f_number=st.floats(2.0, 64.0),
    aperture=st.sampled_from(SHAPES),
    blades=st.integers(3, 9),
    rotation_deg=st.floats(-90, 90),
    normalise=st.sampled_from(["aperture", "lens"]),
    keep_magnification=st.booleans(),
    pixels=st.none() | st.integers(1, 12),
)
narrow_slabs = st.builds(Slab, st.just(NARROW), st.integers(1, 9), st.integers(1, 12))


def no_finer(plane, slab):
    """The plane with no more pixels than the slab."""
    return replace(plane, pixels=plane.pixels and min(plane.pixels, slab.pixels))


def test_shapes_by_hand():
    points = np.array([[0.9, 0.0], [0.7, 0.7], [0.75, 0.75], [0.3, 0.6], [0.95, 0.95], [1.1, 0]])
    s, t = points.T
    inside = {shape: Aperture(shape, 1.0).contains(s, t).tolist() for shape in SHAPES}
    assert inside["square"] == [True, True, True, True, True, False]
    assert inside["circle"] == [True, True, False, True, False, False]
    assert inside["diamond"] == [True, False, False, True, False, False]
    # A hexagon with a corner at +x: apothem sqrt(3) / 2.
    assert inside["polygon"] == [True, False, False, True, False, False]


@given(st.integers(3, 12), st.floats(-180, 180))
@settings(max_examples=40)
def test_polygons_lie_between_their_circles(blades, rotation):
    s, t = np.meshgrid(np.linspace(-1.1, 1.1, 45), np.linspace(-1.1, 1.1, 45))
    polygon = Aperture("polygon", 1.0, blades, rotation).contains(s, t)
    assert not (polygon & ~Aperture("circle", 1.0 + 1e-9).contains(s, t)).any()
    inner = Aperture("circle", math.cos(math.pi / blades) - 1e-9).contains(s, t)
    assert not (inner & ~polygon).any()
    four = Aperture("polygon", 0.999, blades=4).contains(s, t)
    assert (four == Aperture("diamond", 0.999).contains(s, t)).all()


def test_the_whole_lens_is_the_widest_square():
    slab = Slab(NARROW, 6, 4)
    assert SensorPlane(3.0, 2.0, "square").mask(slab).all()
    assert SensorPlane(3.0, 4.0, "square").mask(slab).sum() == 9 + 7  # 4 x 4 of half the width


@given(st.integers(1, 12))
def test_a_pinhole_is_the_central_view(views):
    """The smallest aperture opens the one sample on the axis, or the four around it."""
    mask = SensorPlane(3.0, 1e6).mask(Slab(NARROW, views, 4))
    middle = {(views - 1) // 2, views // 2}
    assert {tuple(index) for index in np.argwhere(mask).tolist()} == {*product(middle, middle)}


@given(narrow_slabs, planes)
@example(Slab(NARROW, 7, 1), SensorPlane(1.0, 7.0, aperture="polygon"))  # samples in its corners
def test_masks_are_symmetric(slab, plane):
    mask = replace(plane, blades=6, rotation_deg=0.0).mask(slab)
    assert (mask == mask[::-1]).all()
    assert (mask == mask[:, ::-1]).all()


def test_shifts_by_hand():
    # delta' - delta = 1 - 1/3; s = -9.375 mm; pitch = field / 8
    slab = Slab(NARROW, 4, 8)
    expected = -9.375e-3 * (2 / 3) / (NARROW.field_width / 8)
    assert SensorPlane(1.0, 2.0).shifts(slab)[0] == pytest.approx(expected)
    np.testing.assert_array_equal(SensorPlane(3.0, 2.0).shifts(slab), 0.0)


@pytest.mark.parametrize("change", [10.0, 1e-1, 1e-5, 1e-7, 0.0, -1e-7, -1e-3, -0.9, math.inf])
def test_shifts_of_many_views_are_exact_to_a_thousandth_of_a_pixel(change):
    slab, focus = Slab(NARROW, 512, 16384), NARROW.focus_m * (1 + change)
    inverse = 0 if math.isinf(focus) else 1 / Fraction(focus)
    difference = (inverse - 1 / Fraction(NARROW.focus_m)) / Fraction(slab.pixel_pitch)
    exact = [float(Fraction(s) * difference) for s in slab.lens_positions().tolist()]
    np.testing.assert_allclose(SensorPlane(focus, 2.0).shifts(slab), exact, atol=1e-3, rtol=0)


def test_magnification_by_hand():
    slab = Slab(NARROW, 1, 9)
    near = SensorPlane(0.5, 2.0, keep_magnification=True)
    # v = 0.05 * 0.5 / 0.45 against 0.05 * 3 / 2.95
    ratio = (0.025 / 0.45) / (0.15 / 2.95)
    assert near.magnification(slab) == pytest.approx(ratio)
    expected = np.floor((np.arange(9) - 4) * ratio + 4 + 0.5)
    np.testing.assert_array_equal(targets(slab, near)[:, 0], expected)


@given(narrow_slabs, planes)
@settings(max_examples=40)
def test_targets_agree_with_the_reference(slab, plane):
    """Every ray has a colour of its own, and is added where ``targets`` says."""
    plane = replace(no_finer(plane, slab), normalise="lens")
    n, m = slab.views, slab.pixels
    light = np.random.default_rng(n * 100 + m).integers(0, 999, (m, m, n, n, 3))
    picture = form_plane(slab, plane, light) * (n * m / plane.side(slab)) ** 2
    expected = np.moveaxis(scattered_sums(slab, plane, light), 0, -1)
    np.testing.assert_allclose(picture, expected, rtol=1e-9)


def _random_sums(slab, chosen, seed):
    generator = np.random.default_rng(seed)
    sums = PlaneSums.zeros(slab, chosen)
    sums.sums[:] = generator.integers(0, FIXED_ONE, sums.sums.shape)
    return sums


def test_partial_sums_add_up_and_survive_the_disk(tmp_path):
    slab, chosen = Slab(NARROW, 3, 6), [SensorPlane(1.0, 2.0), SensorPlane(5.0, 4.0)]
    whole = _random_sums(slab, chosen, 1)
    parts = []
    for top, left in ((0, 0), (0, 2), (3, 0), (3, 2)):
        cut = whole.sums[:, :, top : top + 3, left : left + (2 if left == 0 else 4)].copy()
        part = PlaneSums(slab, chosen, cut, left, top)
        part.save(tmp_path / f"{top}{left}.npz")
        parts.append(PlaneSums.load(tmp_path / f"{top}{left}.npz", slab, chosen))
    grouped = [parts[0], parts[3].with_part(parts[1].with_part(parts[2]))]
    for some in (parts, grouped):
        np.testing.assert_array_equal(total(slab, chosen, some).sums, whole.sums)
    refused("incomplete", parts[0].pictures)
    refused("another slab", parts[0].add, _random_sums(Slab(NARROW, 4, 6), chosen, 2))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["00.npz", "02.npz", "30.npz", "32.npz"]


@given(narrow_slabs, planes)
def test_white_light_is_what_the_reference_makes_of_it(slab, plane):
    """Counts of rays, and the picture of the sums of as many white ones."""
    plane = no_finer(plane, slab)
    side, counts = plane.side(slab), ray_counts(slab, plane)
    white = np.ones((slab.pixels, slab.pixels, slab.views, slab.views, 3))
    share = form_plane(slab, replace(plane, normalise="lens"), white)[..., 0]
    of_pixel = (slab.views * slab.pixels / side) ** 2
    np.testing.assert_allclose(counts, share * of_pixel, rtol=1e-9)
    sums = PlaneSums.zeros(slab, [plane])
    sums.sums[0, :, :side, :side] = counts.astype(np.uint64) * np.uint64(FIXED_ONE)
    np.testing.assert_allclose(sums.pictures()[0], form_plane(slab, plane, white), rtol=1e-6)
