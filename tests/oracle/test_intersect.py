"""The exact closest hit: hand-computed values, exact fractions, and no leaks; slabs and planes."""

import dataclasses
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_scenes import CAMERA, scene, wall
from scattered_planes import form_plane

from lfcore import SensorPlane, Slab
from lfcore.evaluation.stability import shapes
from lfcore.oracle.intersect import closest_hits, occluded
from lfcore.oracle.slab import all_pixels, slab_hits, slab_rays, trace

UNIT = np.float32([[[0, 0, 2], [1, 0, 2], [0, 1, 2]]])


def one(origin, direction, triangles=UNIT, **options):
    return closest_hits(triangles, np.float32([origin]), np.float32([direction]), **options)


def test_hand_computed():
    hits = one((0.25, 0.5, 0), (0, 0, 1))
    assert hits.triangle[0] == 0 and hits.t[0] == 2.0
    assert hits.weights[0].tolist() == [0.25, 0.25, 0.5]
    assert hits.grazing[0] == pytest.approx(1)
    assert one((0.25, 0.5, 4), (0, 0, -4)).t[0] == 0.5  # from behind, in units of direction
    slanted = one((-1.75, 0.5, 0), (1, 0, 1))
    assert slanted.t[0] == 2.0 and slanted.grazing[0] == pytest.approx(np.sqrt(2))
    miss = one((0.75, 0.5, 0), (0, 0, 1))
    assert miss.triangle[0] == -1 and miss.t[0] == np.inf and np.isnan(miss.weights).all()
    assert one((0.25, 0.5, 3), (0, 0, 1)).triangle[0] == -1  # behind
    assert one((0.25, 0.5, 2), (0, 0, 1)).triangle[0] == -1  # on it: t = 0


def test_margin_is_the_angle_to_the_edge():
    angle = 10 * 2.0**-24
    for side, hit in ((1, 0), (-1, -1)):
        hits = one((0, 0, 0), (side * angle, 0.25, 1))
        assert hits.triangle[0] == hit
        # The plane of origin and edge is x = 0; (angle, 0.25, 1) is not of unit length.
        assert hits.margin[0] == pytest.approx(10 / np.sqrt(1 + 0.25**2), rel=1e-6)
    assert one((0, 0, 0), (0, 0.25, 1)).margin[0] == 0
    assert one((0, 0, 0), (0.1, 0.1, 1)).margin[0] == 64


def test_an_edge_behind_the_hit_or_of_a_far_miss_does_not_count():
    behind = np.concatenate([UNIT, UNIT + np.float32([0.25, 0, 1])])
    through_both_edges = one((0.25, 0.25, 0), (0, 0, 1), behind)
    assert through_both_edges.triangle[0] == 0 and through_both_edges.margin[0] == 64
    assert one((0.0, 5.0, 0), (0, 0, 1)).margin[0] == 64  # on the edge's line, far beyond it


def test_gap_to_the_next_triangle():
    two = np.concatenate([UNIT, UNIT + np.float32([0, 0, 2.0**-20])])
    hits = one((0.25, 0.25, 0), (0, 0, 1), two)
    assert hits.triangle[0] == 0 and hits.gap[0] == pytest.approx(8)
    assert not hits.clear()[0] and hits.clear(ulp=4)[0]
    hits = one((0.25, 0.25, 0), (0, 0, 1))
    assert hits.gap[0] == np.inf
    with pytest.raises(ValueError, match="up to 64"):
        hits.clear(64)
    assert one((0.25, 0.25, 0), (0, 0, 1), near=100).clear(64)[0]
    copies = np.concatenate([UNIT + np.float32([0, 0, 1]), UNIT, UNIT, UNIT])
    hits = one((0.25, 0.25, 0), (0, 0, 1), copies)
    assert hits.triangle[0] == 1 and hits.gap[0] == 0
    assert one((0.25, 0.25, 0), (0, 0, 1), copies, exclude=[1]).triangle[0] == 2


def test_invalid_rays_miss_and_leave_the_others_alone():
    origins = np.tile(np.float32([0.25, 0.25, 0]), (20, 1))
    directions = np.tile(np.float32([0, 0, 1]), (20, 1))
    for i, value in enumerate([np.nan, np.inf, -np.inf]):
        origins[i, i] = value
        directions[5 + i, i] = value
    directions[10] = 0
    directions[11] = -0.0
    bad = [0, 1, 2, 5, 6, 7, 10, 11]
    hits = closest_hits(UNIT, origins, directions)
    assert np.flatnonzero(hits.triangle < 0).tolist() == bad
    assert np.flatnonzero(~occluded(UNIT, origins, directions)).tolist() == bad


def test_triangles_without_area_or_not_finite_are_never_hit():
    flat = np.float32(
        [
            [[0, 0, 2]] * 3,
            [[0, 0, 2], [0, 0, 2], [1, 0, 2]],
            [[-1, -1, 2], [0, 0, 2], [1, 1, 2]],
            [[0, 0, 2], [1, 0, np.nan], [0, 1, 2]],
            [[-np.inf, 0, 2], [1, 0, 2], [0, 1, 2]],
        ]
    )
    origins = np.zeros((3, 3), np.float32)
    directions = np.float32([[0, 0, 1], [0.25, 0.25, 1], [0.1, 0, 1]])
    assert (closest_hits(flat, origins, directions).triangle == -1).all()
    both = np.concatenate([flat, [[[-1, -1, 3], [3, -1, 3], [-1, 3, 3]]]])
    assert (closest_hits(both, origins, directions).triangle == 5).all()


def by_cramer(triangle, origin, direction):
    """(t, v, w) of the crossing as fractions, by Cramer's rule; None without one."""
    p, q, r = ([Fraction(float(x)) for x in corner] for corner in triangle)
    o, d = ([Fraction(float(x)) for x in vector] for vector in (origin, direction))
    columns = [[-x for x in d]] + [[b - a for a, b in zip(p, c, strict=True)] for c in (q, r)]
    right = [a - b for a, b in zip(o, p, strict=True)]

    def det(a, b, c):
        return (
            a[0] * (b[1] * c[2] - b[2] * c[1])
            - b[0] * (a[1] * c[2] - a[2] * c[1])
            + c[0] * (a[1] * b[2] - a[2] * b[1])
        )

    whole = det(*columns)
    if whole == 0:
        return None
    t, v, w = (
        det(*(right if k == i else column for k, column in enumerate(columns))) / whole
        for i in range(3)
    )
    return (t, v, w) if v >= 0 and w >= 0 and v + w <= 1 and t > 0 else None


whole = st.integers(-3, 3)
vector = st.tuples(whole, whole, whole)


@settings(max_examples=150)
@given(
    st.lists(st.tuples(vector, vector, vector), min_size=1, max_size=8),
    vector,
    vector,
    st.sampled_from([1.0, 2.0**-100, 2.0**90, 1 / 3]),
    st.sampled_from([0.0, 3.0, 2.0**20]),
)
def test_equals_exact_fractions(corners, origin, direction, scale, offset):
    """Small whole numbers hit edges, vertices and planes all the time."""
    triangles = np.float32(np.float64(corners) * scale + offset * scale)
    origin = np.float32(np.float64(origin) * scale + offset * scale)
    direction = np.float32(direction)
    hits = one(origin, direction, triangles)
    found = [by_cramer(triangle, origin, direction) for triangle in triangles]
    nearest = min((hit[0] for hit in found if hit), default=None)
    if nearest is None:
        assert hits.triangle[0] == -1
        return
    first = [hit is not None and hit[0] == nearest for hit in found].index(True)
    assert hits.triangle[0] == first
    assert hits.t[0] == pytest.approx(float(nearest), rel=1e-9)
    _, v, w = found[first]
    assert hits.weights[0].tolist() == pytest.approx([float(1 - v - w), float(v), float(w)])


def test_occluded_is_a_hit_before_the_end():
    triangles = np.float32(shapes.soup(200))
    rng = np.random.default_rng(4)
    origins = np.zeros((300, 3), np.float32)
    directions = np.c_[rng.uniform(-0.3, 0.3, (300, 2)), np.ones(300)].astype(np.float32)
    hits = closest_hits(triangles, origins, directions)
    until = rng.uniform(2, 4, 300)
    blocked = occluded(triangles, origins, directions, until=until)
    np.testing.assert_array_equal(blocked, hits.t < until)
    assert 0 < blocked.sum() < 300
    again = occluded(triangles, origins, directions, until=until, exclude=hits.triangle)
    second = closest_hits(triangles, origins, directions, exclude=hits.triangle)
    np.testing.assert_array_equal(again, second.t < until)


SLAB = Slab(CAMERA, views=4, pixels=6)
WHOLE = {"focus_m": 2.0, "f_number": 2.0, "aperture": "square"}


def test_rays_start_on_the_lens_and_meet_in_the_focal_plane():
    origins, directions = slab_rays(SLAB, [[0, 5], [3, 2]])
    assert origins.shape == directions.shape == (2, 4, 4, 3)
    assert origins.dtype == directions.dtype == np.float32
    # Radius 0.05 / 4: samples at +-1/8 and +-3/8 of 25 mm, s along the last axis.
    s = np.array([-3, -1, 1, 3]) / 8 * 0.025
    np.testing.assert_allclose(origins[1, 2], np.stack([s, [s[2]] * 4, [0] * 4], -1), rtol=1e-6)
    focused = origins + 2.0 * directions
    # Image distance 0.05 / (1 - 0.025), pixels a sixth of 36 mm over it.
    pitch = 0.036 / (0.05 / 0.975) / 6
    for pixel, (u, v) in enumerate([(-2.5, 2.5), (0.5, -0.5)]):
        expected = [2 * pitch * u, 2 * pitch * v, 2]
        np.testing.assert_allclose(focused[pixel], np.tile(expected, (4, 4, 1)), rtol=1e-5)


def test_depth_and_picture_of_a_wall():
    hits = slab_hits(scene(wall(3)), SLAB, [[0, 0], [5, 3]])
    np.testing.assert_allclose(hits.t, 3.0)
    pixels = all_pixels(SLAB)
    light = trace(scene(wall(3)), SLAB, pixels)
    assert light.shape == (36, 4, 4, 3)
    np.testing.assert_allclose(light, np.broadcast_to([0.05, 0.1, 0.15], light.shape))
    assert pixels[:2].tolist() == [[0, 0], [1, 0]]


@pytest.mark.parametrize("bilinear", [False, True])
def test_the_recorded_focus_is_the_mean_over_the_lens(bilinear):
    light = np.random.default_rng(0).uniform(0, 1, (6, 6, 4, 4, 3))
    picture = form_plane(SLAB, SensorPlane(**WHOLE), light, bilinear=bilinear)
    np.testing.assert_allclose(picture, light.mean((2, 3)))


@pytest.mark.parametrize("bilinear", [False, True])
def test_normalisation(bilinear):
    light = np.full((6, 6, 4, 4, 3), 0.5)
    circle = {"focus_m": 2.0, "f_number": 3.0, "aperture": "circle"}  # the 2 x 2 inside
    assert SensorPlane(**circle).mask(SLAB).sum() == 4
    whole = form_plane(SLAB, SensorPlane(**circle), light, bilinear=bilinear)
    dimmed = form_plane(SLAB, SensorPlane(**circle, normalise="lens"), light, bilinear=bilinear)
    np.testing.assert_allclose(whole, 0.5)
    np.testing.assert_allclose(dimmed, 0.5 * 4 / 16)
    # Nothing recorded lies outside: at the borders fewer rays arrive, and they are counted.
    moved = SensorPlane(**circle | {"focus_m": 0.5})
    np.testing.assert_allclose(form_plane(SLAB, moved, light, bilinear=bilinear), 0.5)


def shifting(slab, pixels):
    """A plane where the rays of neighbouring lens columns fall ``pixels`` apart."""
    delta = slab.camera.delta + pixels * slab.pixel_pitch / slab.lens_pitch_m
    return SensorPlane(1 / delta, 2.0, "square")


@pytest.mark.parametrize("bilinear", [False, True])
def test_rays_that_meet_elsewhere_are_gathered_there(bilinear):
    """Shifts by whole pixels from column to column, rows alike: the middle ones -1/2, 1/2."""
    slab = Slab(CAMERA, views=3, pixels=6)
    plane = shifting(slab, 1)
    np.testing.assert_allclose(plane.shifts(slab), [-1, 0, 1], atol=1e-12)
    light = np.zeros((6, 6, 3, 3, 3))
    for j, i in np.ndindex(3, 3):
        light[3 - (j - 1), 2 - (i - 1), j, i] = 1
    picture = form_plane(slab, plane, light, bilinear=bilinear)
    expected = np.zeros((6, 6, 3))
    expected[3, 2] = 1
    np.testing.assert_allclose(picture, expected, atol=1e-9)


def test_half_a_pixel_goes_up_or_is_shared():
    np.testing.assert_allclose(shifting(SLAB, 1).shifts(SLAB), [-1.5, -0.5, 0.5, 1.5])
    exact = shifting(SLAB, 0.5)
    np.testing.assert_allclose(exact.shifts(SLAB), [-0.75, -0.25, 0.25, 0.75])
    light = np.zeros((6, 6, 4, 4, 3))
    light[2, 3, 2, 0] = 16.0
    dimmed = dataclasses.replace(exact, normalise="lens")
    nearest = form_plane(SLAB, dimmed, light)[..., 0]
    assert nearest[2, 2] == 1 and nearest.sum() == 1  # 3 - 0.75 -> 2, 2 + 0.25 -> 2
    shared = form_plane(SLAB, dimmed, light, bilinear=True)[..., 0]
    expected = np.zeros((6, 6))
    expected[2:4, 2:4] = np.outer([0.75, 0.25], [0.75, 0.25])
    np.testing.assert_allclose(shared, expected, atol=1e-12)


def test_magnification_scales_about_the_centre():
    camera = dataclasses.replace(CAMERA, focus_m=0.1)
    slab = Slab(camera, views=1, pixels=8)
    plane = SensorPlane(np.inf, 2.0, "square", keep_magnification=True)
    assert plane.magnification(slab) == pytest.approx(0.5)  # v = 100 mm to v' = 50 mm
    light = np.arange(64.0).reshape(8, 8, 1, 1, 1) * np.ones(3)
    picture = form_plane(slab, plane, light)
    assert (picture[:2] == 0).all() and (picture[:, 6:] == 0).all()
    # Pixel 2 of the plane receives columns at (u - 3.5) / 2 + 3.5 in [1.5, 2.5): u = 0 and 1.
    np.testing.assert_allclose(picture[2, 2, 0], light[:2, :2].mean((0, 1))[0, 0, 0])
