"""NaN, infinities and random bits, in rays and in triangles: sound neighbours do not notice."""

from dataclasses import replace

import numpy as np
import pytest

from lfcore.evaluation.stability.measurement import mismatches, oracle_hits
from lfcore.evaluation.stability.shapes import random_rays, single, soup
from lfcore.evaluation.stability.tested_tracer import TracerUnderTest, kept

pytestmark = pytest.mark.kernels
PATTERNS = (np.nan, np.inf, -np.inf, 3e38, 1e-45)


@pytest.fixture(scope="module")
def tracer():
    return TracerUnderTest()


@pytest.mark.parametrize("pattern", PATTERNS)
def test_sound_rays_do_not_notice_spoilt_ones(tracer, pattern):
    mesh, rays = single(soup(500)), random_rays(1000)
    origins, directions = (part.copy() for part in rays)
    origins[0::4, 0] = pattern
    directions[2::4, 0] = pattern
    clean, found = tracer.closest(mesh, *rays), tracer.closest(mesh, origins, directions)
    for before, after in zip(clean, found, strict=True):
        np.testing.assert_array_equal(after[1::2], before[1::2])
    if not np.isfinite(pattern):
        assert (found[0][0::2] == -1).all()


@pytest.mark.parametrize("pattern", [*PATTERNS, "random bits"])
def test_spoilt_triangles_are_never_met(tracer, pattern):
    mesh, rays, rng = single(soup(300)), random_rays(1000), np.random.default_rng(14)
    if pattern == "random bits":
        bad = rng.integers(0, 2**32, (300, 3, 3), np.uint32).view(np.float32)
        bad = bad[~kept(bad)]
    else:
        bad = mesh.copy()
        bad[np.arange(300), rng.integers(0, 3, 300), rng.integers(0, 3, 300)] = pattern
    both = np.concatenate([mesh, bad])
    keep = np.append(np.flatnonzero(kept(both)), -1)
    hits = oracle_hits(both[keep[:-1]], rays)
    assert mismatches(tracer.closest(both, *rays), replace(hits, triangle=keep[hits.triangle])) == 0
