"""The exact closest hit: hand-computed values, exact fractions, and no leaks."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lfcore.evaluation.stability import shapes
from lfcore.oracle.intersect import closest_hits, occluded

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
    assert one((0.25, 0.25, 0), (0, 0, 1)).gap[0] == np.inf


def test_nothing_is_said_beyond_the_margins_that_were_measured():
    hits = one((0.25, 0.25, 0), (0, 0, 1))
    with pytest.raises(ValueError, match="up to 64"):
        hits.clear(64)
    assert one((0.25, 0.25, 0), (0, 0, 1), near=100).clear(64)[0]


def test_equal_depths_give_the_lowest_number():
    copies = np.concatenate([UNIT + np.float32([0, 0, 1]), UNIT, UNIT, UNIT])
    hits = one((0.25, 0.25, 0), (0, 0, 1), copies)
    assert hits.triangle[0] == 1 and hits.gap[0] == 0
    assert one((0.25, 0.25, 0), (0, 0, 1), copies, exclude=[1]).triangle[0] == 2


INVALID = [np.nan, np.inf, -np.inf]


def test_invalid_rays_miss_and_leave_the_others_alone():
    origins = np.tile(np.float32([0.25, 0.25, 0]), (20, 1))
    directions = np.tile(np.float32([0, 0, 1]), (20, 1))
    for i, value in enumerate(INVALID):
        origins[i, i] = value
        directions[5 + i, i] = value
    directions[10] = 0
    directions[11] = -0.0
    bad = [0, 1, 2, 5, 6, 7, 10, 11]
    hits = closest_hits(UNIT, origins, directions)
    assert np.flatnonzero(hits.triangle < 0).tolist() == bad
    assert (
        occluded(UNIT, origins, directions).nonzero()[0].tolist()
        == np.setdiff1d(np.arange(20), bad).tolist()
    )


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
