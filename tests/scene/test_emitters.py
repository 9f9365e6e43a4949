"""Points of surfaces that glow. Closed forms: tests/oracle/test_area_lights.py."""

import numpy as np
import pytest
import trimesh

from lfcore.oracle.shading import arriving
from lfcore.scene.appearance import POINT, Light
from lfcore.scene.emitters import POINTS, emitter_points

CORNERS = np.array([[-0.5, -0.5, 0], [-0.5, 0.5, 0], [0.5, 0.5, 0], [0.5, -0.5, 0]])
SQUARE = CORNERS[[[0, 1, 2], [0, 2, 3]]]  # of side 1, facing -z
BALL = trimesh.creation.icosphere(4, radius=0.5).triangles
PLACES = np.stack(np.meshgrid(np.linspace(-4, 4, 17), np.linspace(-4, 4, 17)), -1).reshape(-1, 2)
FLOOR = np.concatenate([PLACES, np.zeros((len(PLACES), 1))], axis=1)


def of_points(triangles, count=POINTS):
    """(P,) irradiance of the floor over radiance, as the oracle adds lights up."""
    points = emitter_points(triangles, count)
    total = np.zeros(len(FLOOR))
    for place, normal, area in zip(*vars(points).values(), strict=True):
        light = Light(POINT, tuple(place), (area,) * 3, 1.0, normal=tuple(normal))
        towards, strength = arriving(light, FLOOR)
        total += np.maximum(towards[:, 2], 0) * strength[:, 0]
    return total


@pytest.mark.parametrize("count, number", [(1, 1), (4, 4), (5, 4), (6, 6), (12, 12), (40, 12)])
def test_points_of_a_sphere_are_a_regular_solid(count, number):
    points = emitter_points(BALL + (3, 4, 5), count)
    assert len(points.areas) == number
    assert not points.normals.any()
    assert points.areas.sum() == pytest.approx(np.pi / 4, rel=1e-9)
    np.testing.assert_allclose(points.positions.mean(0), (3, 4, 5), atol=1e-9)


def test_other_surfaces_keep_their_area_and_have_normals():
    half = BALL[BALL[..., 2].mean(1) > 0]
    for triangles in (trimesh.creation.box().triangles, BALL[:, ::-1], BALL * (1, 1, 2), half):
        edges = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
        area = np.linalg.norm(np.cross(*edges), axis=1).sum() / 2
        points = emitter_points(triangles)
        assert points.areas.sum() == pytest.approx(area, rel=1e-9)
        np.testing.assert_allclose(np.linalg.norm(points.normals, axis=1), 1, atol=1e-12)


def test_stated_error_of_other_surfaces():
    """20% from a diameter on, 5% with 48 points: a long ellipsoid, summed over its triangles."""
    triangles = BALL * (2, 1, 1) + (0, 0, 2)
    double = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    ways = triangles.mean(1) - FLOOR[:, None]
    facing = np.maximum(-(ways * double / 2).sum(-1), 0)
    truth = (facing * ways[..., 2] / (ways**2).sum(-1) ** 2).sum(1)
    for count, limit in ((POINTS, 0.2), (48, 0.05)):
        assert np.abs(of_points(triangles, count) / truth - 1).max() < limit


def test_two_sides_and_surfaces_without_area():
    both = emitter_points(SQUARE, two_sided=True)
    assert both.areas.sum() == pytest.approx(2)
    assert both.normals.sum(0) == pytest.approx(0)
    assert emitter_points(np.zeros((3, 3, 3))) is None
    assert emitter_points(np.zeros((0, 3, 3))) is None


def test_equal_surfaces_have_equal_points():
    first, second = emitter_points(BALL[:77]), emitter_points(BALL[:77].copy())
    np.testing.assert_array_equal(first.positions, second.positions)
