"""The thin lens, the slab and cells of rays, against values worked out by hand."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from lfcore import Aperture, Camera, OpticsError, Slab
from lfcore.optics import bundles
from lfcore.optics.camera import check_focus, image_distance
from lfcore.optics.planes import SHAPES
from lfcore.optics.ray_cells import crossed_views, lens_cells, plain_views
from lfcore.oracle.slab import all_pixels, slab_rays


def test_image_distance_by_hand():
    # f = 50 mm focused at 1 m: v = 0.05 / (1 - 0.05) = 1 / 19 m
    camera = Camera(0.05, 0.036, 2.0, 1.0)
    assert camera.image_distance_m == pytest.approx(1 / 19, rel=1e-15)
    assert camera.field_width == pytest.approx(0.036 * 19, rel=1e-15)
    assert camera.lens_radius_m == pytest.approx(0.0125)
    assert camera.delta == 1.0


def test_focus_at_infinity_is_no_special_case():
    camera = Camera(0.05, 0.036, 2.0, math.inf)
    assert camera.delta == 0.0
    assert camera.image_distance_m == 0.05
    assert Slab(camera, 2, 2).pixel_pitch == pytest.approx(0.36)


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


@pytest.mark.parametrize(
    ("key", "value"),
    [("focal_length_m", 0.0), ("sensor_width_m", -1.0), ("f_number", math.nan)]
    + [("f_number", math.inf), ("focus_m", 0.05), ("focus_m", math.nan)],
)
def test_impossible_cameras_are_refused_by_key(key, value):
    good = {"focal_length_m": 0.05, "sensor_width_m": 0.036, "f_number": 2.0}
    good["focus_m"] = 3.0
    with pytest.raises(OpticsError, match=key):
        Camera(**(good | {key: value}))


def test_check_focus_names_the_remedy():
    with pytest.raises(OpticsError, match=r"where: .*inside the focal length.*Focus farther"):
        check_focus(0.03, 0.05, key="where")


def test_slab_grids_by_hand():
    # radius 12.5 mm, 4 samples: centres of 6.25 mm cells
    slab = Slab(Camera(0.05, 0.036, 2.0, math.inf), 4, 2)
    np.testing.assert_allclose(slab.lens_positions() * 1e3, [-9.375, -3.125, 3.125, 9.375])
    np.testing.assert_allclose(slab.pixel_tangents(), [-0.18, 0.18])
    assert slab.rays == 64


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


@pytest.mark.parametrize(
    ("views", "pixels"), [(0, 4), (4, 0), (2.0, 4), (4, -1), (5000, 4), (4, 70000)]
)
def test_impossible_slabs_are_refused(views, pixels):
    with pytest.raises(OpticsError, match=r"views|pixels"):
        Slab(Camera(0.05, 0.036, 2.0, 3.0), views, pixels)


slabs = st.builds(
    Slab,
    st.builds(
        Camera,
        st.just(0.05),
        st.just(0.036),
        st.sampled_from([1.0, 2.8]),
        st.sampled_from([0.5, 3.0, math.inf]),
    ),
    st.integers(1, 6),
    st.integers(1, 6),
)


@given(slabs)
def test_macropixels_are_the_slab(slab):
    pixels = all_pixels(slab)
    origin, direction = bundles.macropixels(slab, pixels).rays()
    expected_origin, expected_direction = slab_rays(slab, pixels)
    np.testing.assert_allclose(origin, expected_origin, atol=1e-8)
    np.testing.assert_allclose(direction, expected_direction, atol=1e-6)


@given(slabs)
def test_views_are_the_same_rays_in_another_order(slab):
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
    moved = crossed_views(Slab(CAMERA, views, 8)).displacement
    expected = (np.arange(views**2) + 0.5) / views**2 - 0.5
    for axis in range(2):
        np.testing.assert_allclose(np.sort(moved[:, axis]), expected, atol=1e-12)


@pytest.mark.parametrize("views", [4, 8])
def test_a_row_of_views_has_all_places_to_within_its_number(views):
    along_u = crossed_views(Slab(CAMERA, views, 8)).displacement[:, 0].reshape(views, views)
    for line in along_u.T:  # the views of one lens column, row by row
        assert sorted(np.floor((line + 0.5) * views).astype(int)) == list(range(views))


def test_bundles_of_the_slab_itself_are_its_views():
    from lfcore.optics import bundles

    slab = Slab(CAMERA, 3, 5)
    samples = np.array([[i, j] for j in range(3) for i in range(3)])
    mine, theirs = plain_views(slab).bundles(), bundles.views(slab, samples)
    np.testing.assert_allclose(mine.elements, theirs.elements, atol=1e-9)
    np.testing.assert_array_equal(mine.step, theirs.step)


def test_displaced_rays_lie_where_the_displacement_says():
    views = crossed_views(Slab(CAMERA, 3, 5))
    plain = plain_views(views.slab).bundles(slice(2, 7)).rays()[1]
    moved = views.bundles(slice(2, 7)).rays()[1]
    found = (moved - plain)[..., :2] / views.slab.pixel_pitch
    expected = views.displacement[2:7, None, None]
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=1e-4)


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
