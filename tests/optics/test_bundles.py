"""Bundles are the slab's rays, from either side."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lfcore import Camera, Slab
from lfcore.optics import bundles
from lfcore.oracle.slab import all_pixels, slab_rays

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
