"""How elements make up packets, and packets strips."""

import dataclasses

import numpy as np
import pytest
from tracing_scenes import CAMERA

from lfcore.optics.bundles import macropixels, views
from lfcore.optics.slab import Slab
from lfcore.tracing.plan import (
    PLACES,
    PROBED_BLOCKS,
    best_outer,
    leaves_a_ray,
    probed_blocks,
)

SLAB = Slab(CAMERA, 16, 64)


@pytest.mark.parametrize("make", [macropixels, views])
@pytest.mark.parametrize("outer", [1, 2, 4])
def test_probed_rays_are_rays_of_the_slab(make, outer):
    place = np.array([[5, 9]])
    bundles = make(Slab(CAMERA, 16, 16), place)
    inside = np.arange(outer) - (outer - 1) / 2
    around = place + np.stack(np.meshgrid(inside, inside), -1).reshape(-1, 2)
    all_rays = dataclasses.replace(bundles, elements=bundles.lattice.centre_rays(around)).rays()
    there = np.concatenate(all_rays, -1).reshape(-1, 6)
    origins, directions = probed_blocks(bundles, outer)
    assert origins.shape == directions.shape and origins.shape[1:] == (256, 3)
    for ray in np.concatenate([origins, directions], -1).reshape(-1, 6)[::7]:
        assert np.abs(there - ray).max(axis=1).min() < 1e-7


def test_a_whole_picture_is_probed_by_a_few_rays():
    slab = Slab(CAMERA, 16, 512)
    v, u = np.mgrid[:512, :512]
    origins, _ = probed_blocks(macropixels(slab, np.stack([u.ravel(), v.ravel()], 1)), 1)
    assert len(origins) == PROBED_BLOCKS * PLACES


def test_a_block_spans_more_where_its_rays_meet_fewer_triangles_for_it():
    def hits(count):
        """What a scene of squares ``count`` to the metre, two metres away, would answer."""

        def closest_hit(origins, directions):
            cell = np.floor((origins + 2.0 * directions)[:, :2] * count).astype(int)
            return (cell[:, 0] % 4096 * 4096 + cell[:, 1] % 4096,)

        return closest_hit

    coarse, fine = hits(1), hits(400)
    blurred = macropixels(Slab(SLAB.camera, 16, 512), np.array([[3, 200], [400, 7]]))
    assert best_outer(coarse, blurred, "FRAMES") == 1
    far = Slab(dataclasses.replace(CAMERA, focus_m=50.0), 16, 512)
    assert best_outer(fine, macropixels(far, np.array([[3, 200], [400, 7]])), "FRAMES") == 4


def test_leaves_in_the_way_of_a_narrow_block_are_fewer():
    rng = np.random.default_rng(3)
    middle = rng.uniform([-1, -1, 3], [1, 1, 6], (4000, 3))
    boxes = np.concatenate([middle - 0.01, middle + 0.01], 1).astype(np.float32)
    bundles = macropixels(Slab(SLAB.camera, 16, 512), rng.integers(0, 512, (16, 2)))
    wide, narrow = (leaves_a_ray(boxes, bundles, outer) for outer in (1, 4))
    assert 0 < narrow < wide
