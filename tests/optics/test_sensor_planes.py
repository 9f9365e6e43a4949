"""Apertures, sensor planes, targets, counts and exact sums."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from lfcore import Aperture, Camera, OpticsError, SensorPlane, Slab
from lfcore.optics.plane_sums import FIXED_ONE, PlaneSums, ray_counts, targets, total
from lfcore.optics.planes import SHAPES
from lfcore.oracle.planes import form_plane

CAMERA = Camera(0.05, 0.036, 2.0, 3.0)
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
slabs = st.builds(Slab, st.just(CAMERA), st.integers(1, 9), st.integers(1, 12))


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


def test_four_blades_are_a_diamond():
    s, t = np.meshgrid(np.linspace(-1.2, 1.2, 51), np.linspace(-1.2, 1.2, 51))
    polygon = Aperture("polygon", 0.999, blades=4).contains(s, t)
    assert (polygon == Aperture("diamond", 0.999).contains(s, t)).all()


@given(st.integers(3, 12), st.floats(-180, 180))
@settings(max_examples=40)
def test_polygons_lie_between_their_circles(blades, rotation):
    s, t = np.meshgrid(np.linspace(-1.1, 1.1, 45), np.linspace(-1.1, 1.1, 45))
    polygon = Aperture("polygon", 1.0, blades, rotation).contains(s, t)
    assert not (polygon & ~Aperture("circle", 1.0 + 1e-9).contains(s, t)).any()
    inner = Aperture("circle", math.cos(math.pi / blades) - 1e-9).contains(s, t)
    assert not (inner & ~polygon).any()


def test_unknown_words_are_refused():
    with pytest.raises(OpticsError, match="unknown aperture 'heart'"):
        Aperture("heart", 1.0)
    with pytest.raises(OpticsError, match="at least 3 blades"):
        Aperture("polygon", 1.0, blades=2)
    with pytest.raises(OpticsError, match="unknown normalisation 'sum'"):
        SensorPlane(3.0, 2.0, normalise="sum")


def test_what_was_not_recorded_is_refused():
    slab = Slab(CAMERA, 4, 4)
    SensorPlane(3.0, 2.0).check(slab)
    with pytest.raises(OpticsError, match=r"f/1.4 is wider than the lens, f/2\."):
        SensorPlane(3.0, 1.4).check(slab)
    with pytest.raises(OpticsError, match="focus_m"):
        SensorPlane(0.05, 2.0).check(slab)


def test_the_whole_lens_is_the_widest_square():
    slab = Slab(CAMERA, 6, 4)
    assert SensorPlane(3.0, 2.0, "square").mask(slab).all()
    assert SensorPlane(3.0, 4.0, "square").mask(slab).sum() == 9 + 7  # 4 x 4 of half the width


@given(st.integers(1, 12))
def test_a_pinhole_is_the_central_view(views):
    """The smallest aperture opens the one sample on the axis, or the four around it."""
    mask = SensorPlane(3.0, 1e6).mask(Slab(CAMERA, views, 4))
    middle = {(views - 1) // 2, views // 2}
    assert {tuple(index) for index in np.argwhere(mask).tolist()} == {
        (j, i) for j in middle for i in middle
    }


@given(slabs, planes)
@example(Slab(CAMERA, 7, 1), SensorPlane(1.0, 7.0, aperture="polygon"))  # samples in its corners
def test_masks_are_symmetric(slab, plane):
    mask = replace(plane, blades=6, rotation_deg=0.0).mask(slab)
    assert (mask == mask[::-1]).all()
    assert (mask == mask[:, ::-1]).all()


def test_shifts_by_hand():
    # delta' - delta = 1 - 1/3; s = -9.375 mm; pitch = field / 8
    slab = Slab(CAMERA, 4, 8)
    expected = -9.375e-3 * (2 / 3) / (CAMERA.field_width / 8)
    assert SensorPlane(1.0, 2.0).shifts(slab)[0] == pytest.approx(expected)
    np.testing.assert_array_equal(SensorPlane(3.0, 2.0).shifts(slab), 0.0)


@pytest.mark.parametrize("change", [10.0, 1e-1, 1e-5, 1e-7, 0.0, -1e-7, -1e-3, -0.9, math.inf])
def test_shifts_of_many_views_are_exact_to_a_thousandth_of_a_pixel(change):
    slab, focus = Slab(CAMERA, 512, 16384), CAMERA.focus_m * (1 + change)
    inverse = 0 if math.isinf(focus) else 1 / Fraction(focus)
    difference = (inverse - 1 / Fraction(CAMERA.focus_m)) / Fraction(slab.pixel_pitch)
    exact = [float(Fraction(s) * difference) for s in slab.lens_positions().tolist()]
    np.testing.assert_allclose(SensorPlane(focus, 2.0).shifts(slab), exact, atol=1e-3, rtol=0)


def test_magnification_by_hand():
    slab = Slab(CAMERA, 1, 9)
    near = SensorPlane(0.5, 2.0, keep_magnification=True)
    # v = 0.05 * 0.5 / 0.45 against 0.05 * 3 / 2.95
    ratio = (0.025 / 0.45) / (0.15 / 2.95)
    assert near.magnification(slab) == pytest.approx(ratio)
    assert targets(slab, near)[:, 0].tolist() == [
        math.floor((u - 4) * ratio + 4 + 0.5) for u in range(9)
    ]


@given(slabs, planes)
def test_counts_are_what_the_reference_makes_of_white_light(slab, plane):
    plane = replace(no_finer(plane, slab), normalise="lens")
    white = np.ones((slab.pixels, slab.pixels, slab.views, slab.views, 3))
    of_pixel = (slab.views * slab.pixels / plane.side(slab)) ** 2
    expected = form_plane(slab, plane, white)[..., 0] * of_pixel
    np.testing.assert_allclose(ray_counts(slab, plane), expected, rtol=1e-9)


@given(slabs, planes)
@settings(max_examples=40)
def test_targets_agree_with_the_reference(slab, plane):
    """Every ray has a colour of its own, and is added where ``targets`` says."""
    plane = replace(no_finer(plane, slab), normalise="lens")
    side, n, m = plane.side(slab), slab.views, slab.pixels
    light = np.random.default_rng(n * 100 + m).random((m, m, n, n, 1)).repeat(3, -1)
    columns, mask = targets(slab, plane), plane.mask(slab)
    y, x = columns[:, None, :, None], columns[None, :, None, :]
    counts = mask & (x >= 0) & (x < side) & (y >= 0) & (y < side)
    at = np.broadcast_to(y * side + x, counts.shape)[counts]
    expected = np.bincount(at, light[counts][:, 0], side**2).reshape(side, side)
    picture = form_plane(slab, plane, light)[..., 0] * (n * m / side) ** 2
    np.testing.assert_allclose(picture, expected, rtol=1e-9)


def _random_sums(slab, chosen, seed):
    generator = np.random.default_rng(seed)
    sums = PlaneSums.zeros(slab, chosen)
    sums.sums[:] = generator.integers(0, FIXED_ONE, sums.sums.shape)
    return sums


def test_partial_sums_add_up_and_survive_the_disk(tmp_path):
    slab, chosen = Slab(CAMERA, 3, 6), [SensorPlane(1.0, 2.0), SensorPlane(5.0, 4.0)]
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
    with pytest.raises(OpticsError, match="not whole"):
        parts[0].pictures()
    with pytest.raises(OpticsError, match="another slab"):
        parts[0].add(_random_sums(Slab(CAMERA, 4, 6), chosen, 2))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["00.npz", "02.npz", "30.npz", "32.npz"]


@given(slabs, planes)
def test_white_light_gives_a_white_or_dimmed_picture(slab, plane):
    """Every ray white: 1 where some ray fell; with the lens's normalisation the share of rays."""
    plane = no_finer(plane, slab)
    sums, side = PlaneSums.zeros(slab, [plane]), plane.side(slab)
    counts = ray_counts(slab, plane)
    sums.sums[0, :, :side, :side] = counts.astype(np.uint64) * np.uint64(FIXED_ONE)
    picture = sums.pictures()[0]
    if plane.normalise == "aperture":
        expected = (counts > 0).astype(np.float32)
    else:
        expected = (counts / (slab.views * slab.pixels / side) ** 2).astype(np.float32)
    np.testing.assert_allclose(picture, np.repeat(expected[..., None], 3, 2), rtol=1e-6)
