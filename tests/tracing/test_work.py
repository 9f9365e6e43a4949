"""How elements make up beams, and beams strips."""

import numpy as np
import pytest

from lfcore.tracing.work import group_elements


@pytest.mark.parametrize("group, tall", [(4, 1), (4, 3), (2, 4), (1, 8), (1, 1)])
def test_groups_hold_each_element_once_at_its_place(group, tall):
    rng = np.random.default_rng(7)
    places = rng.permutation(np.argwhere(rng.random((23, 18)) < 0.6))
    beams = group_elements(places, group, tall)
    assert beams.shape[1] == group**2 and len(beams) % tall == 0
    assert sorted(beams[beams >= 0]) == list(range(len(places)))
    for number, beam in enumerate(beams):
        for slot, element in enumerate(beam):
            if element < 0 or group == tall == 1:
                continue
            u, v = places[element]
            assert slot == v % group * group + u % group
            assert number % tall == v // group % tall
    for strip in beams.reshape(-1, tall * group**2):
        corners = places[strip[strip >= 0]] // (group, group * tall)
        assert (corners == corners[0]).all(), "beams of a strip lie one below the other"
