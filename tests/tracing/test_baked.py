"""Light that was baked, and skies, against float64."""

from dataclasses import replace

import numpy as np
import pytest
from tracing_scenes import CAMERA, WALL, scene, slab_colours, soup

from lfcore.optics.slab import Slab
from lfcore.scene.appearance import Material
from lfcore.scene.baked import BakedLight
from lfcore.scene.sky_gloss import LEVELS, SIDE, reflected_shares, sky_gloss
from lfcore.tracing.surfaces import pack_light

pytestmark = pytest.mark.kernels


def lit(triangles, seed=1):
    """Random light, as points hold it, on grids of 1, 2, 4 and 7 cells, and a random sky."""
    rng = np.random.default_rng(seed)
    sides = rng.choice([1, 2, 4, 7], len(triangles))
    counts = (sides + 1) * (sides + 2) // 2
    ends = np.cumsum(2 * counts)
    grids = np.stack([ends - 2 * counts, ends - counts, sides], 1).astype(np.int32)
    values = rng.random((ends[-1], 3)).astype(np.float32)
    step = 2.0 ** (np.ceil(np.log2(values.max(1, keepdims=True))) - 9)
    values = (np.rint(values / step).clip(0, 511) * step).astype(np.float32)
    sky = rng.random((16, 16, 3)).astype(np.float32)
    return scene(triangles, light=BakedLight(grids, values), sky=sky)


@pytest.mark.parametrize("outer", [1, 2, 4])
@pytest.mark.parametrize("wall", [True, False])
def test_colours_are_the_oracles(device, outer, wall):
    triangles = np.concatenate([soup(40, 2, 0.5), WALL[: 2 * wall]])
    found, expected = slab_colours(lit(triangles), Slab(CAMERA, 16, 8), device, outer=outer)
    off = abs(found - expected).max(-1)
    # Slivers amplify the rounding of their weights.
    assert np.quantile(off, 0.99) < 2e-4 and off.mean() < 1e-3


@pytest.mark.parametrize("ripple", [1, 16])
def test_light_that_is_nearly_affine_over_a_block_is_made_affine(device, ripple):
    """A ripple below a 256th of the light is lost, and a larger one is not."""
    side = 7
    j, i = np.array([(j, i) for j in range(side + 1) for i in range(side + 1 - j)]).T
    values = (400 + 8 * i + 4 * j + ripple * ((i + j) % 2))[:, None] * np.full(3, 1 / 512)
    grids = np.int32([[0, len(i), side], [2 * len(i), 3 * len(i), side]])
    world = scene(WALL, light=BakedLight(grids, np.tile(values, (4, 1)).astype(np.float32)))
    found, expected = slab_colours(world, Slab(CAMERA, 16, 8), device, outer=1)
    share = (abs(found - expected) / expected).max(-1)
    if ripple == 1:
        assert share.max() < 1 / 256 and np.median(share) > 2e-4
    else:
        assert share.max() < 1e-4


@pytest.mark.parametrize("metallic", [0.0, 0.6, 1.0])
def test_gloss_is_the_oracles(device, metallic):
    """Metals of every roughness under a sky, dimmed where baked light is below the open sky's."""
    triangles = np.concatenate([soup(60, 3, 0.5), WALL[:2]])
    world = lit(triangles, 4)
    materials = [
        Material(f"{k}", (0.9, 0.6, 0.3), metallic=metallic, roughness=k / 8) for k in range(9)
    ]
    ids = np.arange(len(triangles), dtype=np.int32) % 9
    world = replace(world, materials=materials, material_ids=ids)
    found, expected = slab_colours(world, Slab(CAMERA, 16, 8), device)
    off = abs(found - expected).max(-1)
    assert np.quantile(off, 0.99) < 5e-4 and off.mean() < 1e-3


def test_points_hold_light_to_a_512th_of_the_brightest_colour():
    """Or to 2^-25 of white; light above what points hold is the most that they hold."""
    rng = np.random.default_rng(5)
    size = 2.0 ** rng.uniform(-16, 16, (1000, 1))
    values = size * rng.uniform(0, 1, (1000, 3)) ** 2
    values[:4] = [[0, 0, 0], [511.9, 1, 0], [1e9, 5, 0], [2.0**-16, 0, 0]]
    points = pack_light(values)
    held = (points[:, None] >> (0, 9, 18) & 511) * 2.0 ** ((points[:, None] >> 27) - 24.0)
    values = np.minimum(values, 511 * 128)
    assert (abs(held - values).max(1) <= np.maximum(values.max(1) / 510, 2.0**-25)).all()


def test_a_mirror_shows_the_sky_and_an_even_sky_is_kept():
    """White metal under an even sky of 1 reflects about 1, the rougher the less."""
    table = reflected_shares()
    assert (table[..., 0] + table[..., 1] <= 1.001).all()
    assert table[2, 16:, 0].min() > 0.95
    even = sky_gloss(np.ones((16, 16, 3), np.float32))[: (LEVELS + 1) * SIDE**2]
    assert abs(even - 1).max() < 1e-3
