"""How elements make up packets, and packets strips."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tracing_scenes import CAMERA

from lfcore.optics.bundles import ElementLattice, macropixels, views
from lfcore.optics.slab import Slab
from lfcore.tracing.packets import Groups, PacketShape, ranks
from lfcore.tracing.plan import (
    PLACES,
    PROBED_BLOCKS,
    best_outer,
    leaves_a_ray,
    probed_blocks,
)

SLAB = Slab(CAMERA, 16, 64)


@given(st.lists(st.integers(-3, 3), min_size=1, max_size=40))
def test_ranks_are_those_of_all_distinct_keys(keys):
    found = ranks(np.array(keys))
    for ours, theirs in zip(found, np.unique(keys, return_inverse=True), strict=True):
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("group, strip_height", [(4, 1), (4, 3), (2, 4), (1, 8), (1, 1)])
def test_groups_hold_each_element_once_at_its_place(group, strip_height):
    rng = np.random.default_rng(7)
    places = rng.permutation(np.argwhere(rng.random((23, 18)) < 0.6))
    shape = PacketShape(1, group)
    packets = Groups.of(shape, macropixels(SLAB, places), places, strip_height).members
    assert packets.shape[1] == group**2 and len(packets) % strip_height == 0
    assert sorted(packets[packets >= 0]) == list(range(len(places)))
    for number, packet in enumerate(packets):
        for slot, element in enumerate(packet):
            if element < 0 or group == strip_height == 1:
                continue
            u, v = places[element]
            assert slot == v % group * group + u % group
            assert number % strip_height == v // group % strip_height
    for strip in packets.reshape(-1, strip_height * group**2):
        corners = places[strip[strip >= 0]] // (group, group * strip_height)
        assert (corners == corners[0]).all(), "packets of a strip lie one below the other"


@pytest.mark.parametrize("outer", [2, 4])
@pytest.mark.parametrize("strip_height", [1, 3])
def test_blocks_of_several_elements_lie_where_these_are_whichever_are_there(outer, strip_height):
    shape = PacketShape.for_inner(16, outer)
    places = np.stack(np.meshgrid(np.arange(3, 17), np.arange(5, 12)), -1).reshape(-1, 2)
    some = places[np.random.default_rng(1).random(len(places)) < 0.5]
    bundles = macropixels(SLAB, some)
    groups = Groups.of(shape, bundles, some, strip_height)
    assert len(groups.centre_rays) == len(groups.members)
    lattice = bundles.lattice
    inside = np.arange(outer) - (outer - 1) / 2
    for members, middle in zip(groups.members, groups.centre_rays, strict=True):
        for slot, element in enumerate(members):
            if element < 0:
                continue
            v, u = divmod(slot, outer)
            expected = bundles.elements[element]
            assert np.allclose(middle[2] + inside[u] * lattice.direction, expected[2], atol=1e-7)
            assert np.allclose(middle[3] + inside[v] * lattice.direction, expected[3], atol=1e-7)


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


def test_a_lattice_gives_its_elements():
    lattice = ElementLattice(5, 0.01, -0.002)
    assert np.array_equal(lattice.centre_rays([[2, 2]]), np.zeros((1, 4), np.float32))
    found = lattice.centre_rays(np.array([[0, 4], [1.5, 2]]))
    expected = [[-0.02, 0.02, 0.004, -0.004], [-0.005, 0, 0.001, 0]]
    assert np.allclose(found, expected, atol=1e-9)
