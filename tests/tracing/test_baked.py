"""Light that was baked, and skies, against float64."""

import numpy as np
import pytest
from tracing_scenes import CAMERA, WALL, colours, scene, soup

from lfcore.optics.bundles import macropixels
from lfcore.optics.slab import Slab
from lfcore.oracle.slab import all_pixels
from lfcore.scene.baked import BakedLight

pytestmark = pytest.mark.kernels


def lit(triangles, seed=1):
    """Random light on grids of 1, 2, 4 and 7 cells, and a random sky."""
    rng = np.random.default_rng(seed)
    sides = rng.choice([1, 2, 4, 7], len(triangles))
    counts = (sides + 1) * (sides + 2) // 2
    ends = np.cumsum(2 * counts)
    grids = np.stack([ends - 2 * counts, ends - counts, sides], 1).astype(np.int32)
    values = rng.random((ends[-1], 3)).astype(np.float32)
    sky = rng.random((16, 16, 3)).astype(np.float32)
    return scene(triangles, light=BakedLight(grids, values), sky=sky)


@pytest.mark.parametrize("outer", [1, 2, 4])
@pytest.mark.parametrize("wall", [True, False])
def test_colours_are_the_oracles(device, outer, wall):
    triangles = np.concatenate([soup(40, 2, 0.5), WALL[: 2 * wall]])
    world, slab = lit(triangles), Slab(CAMERA, 16, 8)
    pixels = all_pixels(slab)
    found, expected = colours(world, macropixels(slab, pixels), pixels, device, outer=outer)
    off = abs(found - expected).max(-1)
    # Slivers amplify the rounding of their weights.
    assert np.quantile(off, 0.99) < 2e-4 and off.mean() < 1e-3
