"""Pictures of mirrors and coats: a plane mirror shows the scene unfolded behind it."""

import numpy as np
import pytest
from mirror_room import CAMERA, PIXELS, PLANES, make_scene, wall

from lfcore.evaluation.metrics import psnr
from lfcore.optics.slab import Lattice
from lfcore.rendering.by_depth import pictures_by_depth
from lfcore.rendering.prepared import open_tracer

pytestmark = pytest.mark.kernels
MIRROR_Z = 4.0


def pictures(front, behind, **material):
    """Of ``front``, whose material is given, and of matt surfaces ``behind`` the camera or it."""
    scene = make_scene([(*front, material), (*behind, {})])
    return pictures_by_depth(open_tracer(scene), CAMERA, PLANES, PIXELS, Lattice(4, 2))


def reflected(shapes):
    triangles, colours = shapes
    return triangles * np.float32([1, 1, -1]) + np.float32([0, 0, 2 * MIRROR_Z]), colours


@pytest.fixture(scope="module")
def room():
    """A mirror's place; and a wall and a rod behind the camera, of any colours."""
    rng = np.random.default_rng(2)
    parts = wall(-4.0, -6, 6, 40, rng), wall(-1.0, -0.3, 0.1, 2, rng)
    behind = tuple(np.concatenate(both) for both in zip(*parts, strict=True))
    return wall(MIRROR_Z, -6, 6, 24, rng), behind


def test_a_plane_mirror_is_a_window_to_the_unfolded_scene(room):
    """The same rays, the same depths: the same picture."""
    (place, _), behind = room
    white = np.ones_like(place)
    mirror = pictures((place, white), behind, metallic=1.0, roughness=0.0, diffuse=(1.0,) * 3)
    nothing = np.zeros((0, 3, 3), np.float32)
    window = pictures((nothing, nothing), reflected(behind))
    np.testing.assert_allclose(mirror, window, atol=2e-3)


def test_a_coat_adds_what_it_reflects_to_its_own_light(room):
    """At normal incidence a coat reflects 0.04, and lets pass the rest twice."""
    front, behind = room
    nothing = np.zeros((0, 3, 3), np.float32)
    body = pictures(front, (nothing, nothing))
    window = pictures((nothing, nothing), reflected(behind))
    coat = pictures(front, behind, clearcoat=1.0)
    middle = slice(12, 20)
    for own, shown, found in zip(body, window, coat, strict=True):
        part = own[middle, middle], shown[middle, middle], found[middle, middle]
        assert psnr(0.96 * part[0] + 0.04 * part[1], part[2], peak=1) > 45
        assert np.abs(part[2] - part[0]).max() > 0.01
