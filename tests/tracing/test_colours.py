"""Colours against the oracle: of single elements and small triangles, above white, and baked."""

from dataclasses import replace

import numpy as np
import pytest
from plain_scenes import wall
from tracing_scenes import (
    CAMERA,
    LAMP,
    SUN,
    WALL,
    baked,
    colours,
    curved,
    lit_soup,
    mesh,
    scene,
    slab_colours,
    soup,
    traced,
    tracer_of,
    unit,
)

import lfcore
from lfcore import BakedLight, Slab
from lfcore.optics import bundles
from lfcore.optics.bundles import Bundles, macropixels
from lfcore.oracle import colour as truth
from lfcore.oracle.shading import radiance
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light, Material
from lfcore.scene.needs import Needs
from lfcore.scene.sky_gloss import LEVELS, SIDE, reflected_shares, sky_gloss
from lfcore.storage.layout import FrameLayout
from lfcore.tracing import device_scene
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.surfaces import pack_light
from lfcore.tracing.tracer import Tracer

pytestmark = pytest.mark.kernels

NEAR = Light(POINT, (0.01, 0.01, 2.985), (0.4, 0.4, 0.4), 0.0, False)
LOW_SUN = Light(DIRECTIONAL, unit(1.0, 0.0, -0.1), (0.7, 0.7, 0.7), 0.0, False)
PIXELS = [[12, 11], [1, 22], [6, 17]]


def noise():
    return np.random.default_rng(2).integers(0, 256, (16, 16, 3), np.uint8)


WORLDS = {
    "lamp": lambda: curved([LAMP]),
    "two lights": lambda: curved([LAMP, SUN]),
    "near light": lambda: curved([NEAR]),
    "terminator": lambda: curved([LOW_SUN]),
    "narrow highlights": lambda: curved([LAMP], 4000.0),
    "curled": lambda: curved([LAMP], bend=3.0),
}


def one_element(world, device=None, views=40, pixels=PIXELS[:2]):
    return colours(
        world, macropixels(Slab(CAMERA, views, 24), pixels), pixels, device, spanning=False
    )


@pytest.mark.parametrize("name", WORLDS)
def test_regions_are_the_oracles(device, name):
    found, truth = one_element(WORLDS[name](), device)
    error = np.abs(np.clip(found, 0, 1) - truth).max(1)
    assert truth.std() > 0.05
    assert np.quantile(error, 0.98) < 2e-6  # beside edges rounding decides


@pytest.mark.parametrize("scale", [3, 12, 60, 120, 400])
def test_texel_tiles_of_any_size(device, scale):
    """From one texel, of ten bits of its root, in a block to more than a tile holds, in shadows."""
    world = curved([LAMP], texture=noise())
    world = replace(world, uvs=(world.triangles[..., :2] * scale).astype(np.float32))
    found, truth = one_element(world, device)
    error = np.abs(np.clip(found, 0, 1) - truth).max(1)
    assert np.quantile(error, 0.98) < 1e-3


def test_a_plane_through_the_lens_has_two_sides(device):
    """Some blocks of a packet see it from above and others from below: each in its own light."""
    slab, pixel = Slab(CAMERA, 70, 24), [[12, 11]]
    origins, directions = (a[0].astype(float) for a in macropixels(slab, pixel).rays())
    slope = directions[:, 0, 1] / directions[:, 0, 2]
    rows = origins[:, 0, 1]
    focus = (rows[-1] - rows[0]) / (slope[0] - slope[-1])
    # Half a row below the plane at the focus: what lies above it on the lens meets it before, what
    # lies below it beyond.
    level, step = rows[24], rows[1] - rows[0]
    tilt = (rows[0] + slope[0] * focus - level + step / 2) / focus
    corners = [(x, level + tilt * z, z) for x, z in ((0, 0.1), (-40, 90), (40, 90))]
    sun = Light(DIRECTIONAL, (0.0, 0.96, -0.28), (0.8, 0.7, 0.6), 0.0, False)
    world = scene(np.float32([corners]), lights=[sun])
    found, truth = (a.reshape(70, 70, 3) for a in one_element(world, device, 70, pixel))
    lit = truth[..., 0] > 0.3
    assert lit[rows > level + step].any() and not lit[rows < level - step].any()
    assert np.quantile(np.abs(found - truth).max(-1), 0.98) < 1e-4


DEPTH, BLOCK_WIDTH_M, CELLS = 3.0, 1.0, 24
STEP = BLOCK_WIDTH_M / 16 / DEPTH


def dense_mesh(edge_m):
    """A tilted square of CELLS x CELLS cells with wavy normals and colours that change slowly."""
    n = np.arange(CELLS + 1)
    x, y = np.meshgrid((n - CELLS / 2) * edge_m, (n - CELLS / 2) * edge_m)
    u, v = np.meshgrid(n / CELLS, n / CELLS)
    normals = np.stack([np.sin(8 * np.pi * u) / 2, np.cos(6 * np.pi * v) / 2, -np.ones_like(u)], -1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)

    return scene(
        mesh(np.stack([x, y, DEPTH + 0.2 * x + 0.3 * y], -1)),
        normals=mesh(normals),
        colours=mesh(np.stack([u, v, 1 - u], -1)),
        lights=[Light(DIRECTIONAL, unit(0.3, -0.4, -1), (0.6, 0.6, 0.6), casts_shadows=False)],
    )


@pytest.mark.parametrize("edge_m", [1e-2, 1e-3, 1e-4])
def test_colours_and_normals_of_small_triangles_are_the_oracles(edge_m):
    """Blocks 1 m wide, in each of which one ray is aimed at the mesh."""
    world, rng = dense_mesh(edge_m), np.random.default_rng(1)
    aim = rng.uniform(-0.45, 0.45, (200, 2)) * CELLS * edge_m
    column, row = rng.integers(0, 16, (2, len(aim)))
    elements = np.zeros((len(aim), 4), np.float32)
    elements[:, 2:] = aim / (DEPTH + aim @ [0.2, 0.3])[:, None]
    elements[:, 2:] -= (np.stack([column, row], 1) - 7.5) * STEP
    bundles = Bundles(elements, np.float32([0, 0, STEP, STEP]), 16, 16, STEP)
    tracer = Tracer(world, build_bvh(world.triangles), single_rays=False, mipmaps=False)
    aimed = np.arange(len(aim)), row, column
    true = radiance(world, *(rays[aimed] for rays in bundles.rays()))
    assert (true != np.float32(world.background)).any(axis=1).all()
    assert np.abs(tracer.bundle_radiance(bundles)[aimed] - true).max() * 255 < 0.05


# Above 5 stops sums are coarser.
@pytest.mark.parametrize(
    ("kind", "stops"), [("macropixels", 5), ("macropixels", 16), ("views", 1), ("views", 12)]
)
def test_sums_hold_all_stops(kind, stops):
    light = 0.7 * 2.0**stops
    world = scene(wall(9.0, 1e-3), background=(light, 0.01, 0.9), clip=False)
    assert Needs.of(world).stops == stops
    layout, plane = FrameLayout(kind, 8, 12), lfcore.SensorPlane(3.0, 2.0)
    picture = traced(tracer_of(world), layout, [plane], frames=False)[1].pictures()[0]
    middle = picture[1:-1, 1:4]
    # At sixteen stops a half is 256, and rays of a row are rounded by unlike parts of one.
    np.testing.assert_allclose(middle[..., 0], light, rtol=1e-6)
    np.testing.assert_allclose(middle[..., 1:], np.broadcast_to([0.01, 0.9], (10, 3, 2)), atol=3e-4)


def test_unclipped_shading_is_the_oracles():
    soup = lit_soup()
    light = Light(POINT, (1.0, -2.0, 0.5), (30.0, 20.0, 10.0), 2.0, True)
    world = replace(soup, clip=False, lights=[light], background=(3.0, 2.0, 1.0))
    rays = bundles.views(Slab(world.camera, 4, 24), np.array([[0, 0], [3, 2]]))
    found, expected = colours(world, rays)
    assert expected.max() > 5
    error = np.abs(found - expected).max(-1) / np.maximum(1, expected.max(-1))
    assert (error > 0.01).mean() < 5e-3 and np.median(error) < 1e-4


@pytest.mark.parametrize("form", ["yuv444p10le", "yuv420p12le"])
@pytest.mark.parametrize("light", [0.001, 0.4, 1.0, 30.0, 64.0])
def test_frames_have_the_codes_of_the_standard(form, light):
    world = scene(wall(9.0, 1e-3), background=(light,) * 3, ambient=(128.0,) * 3, clip=False)
    layout = FrameLayout("views", 2, 16, pixel_format=form, peak=64.0)
    frames = traced(tracer_of(world), layout)[0]
    luma = layout.format.views(frames, layout.frame_width, layout.frame_height)[0][:, 1, 1]
    scale = 1 << (layout.format.bits - 8)
    assert np.abs(luma - scale * (16 + 219 * truth.pq(light / 64))).max() <= 0.51


@pytest.mark.parametrize("spanning", [False, True])
@pytest.mark.parametrize("wall", [True, False])
def test_baked_light_is_the_oracles(device, spanning, wall):
    triangles = np.concatenate([soup(40, 2, 0.5), WALL[: 2 * wall]])
    found, expected = slab_colours(baked(triangles), Slab(CAMERA, 16, 8), device, spanning=spanning)
    off = abs(found - expected).max(-1)
    # Slivers amplify the rounding of their weights; light within a 64th of an affine function is
    # one.
    assert np.quantile(off, 0.9) < 2e-4 and off.max() < 1 / 64 and off.mean() < 1e-4


def on_wall(light, device):
    """By how much of it a wall on fine grids looks other than the oracle says."""
    side = 512
    j, i = np.array([(j, i) for j in range(side + 1) for i in range(side + 1 - j)]).T
    values = (light(i + j) / 512)[:, None] * np.ones(3)
    grids = np.int32([[0, len(i), side], [2 * len(i), 3 * len(i), side]])
    held = BakedLight(grids, np.tile(values, (4, 1)).astype(np.float32))
    world = scene(WALL, light=held, sky=np.ones((16, 16, 3), np.float32))
    found, expected = slab_colours(world, Slab(CAMERA, 16, 8), device, spanning=False)
    return (abs(found - expected) / expected).max(-1)


def test_even_light_is_affine_over_a_block(device):
    """A ripple from point to point, below a 64th of the light, is lost."""
    share = on_wall(lambda row: 300 + row / 8 + 6 * (row % 2), device)
    assert share.max() < 1 / 64 and np.median(share) > 2e-3


@pytest.mark.parametrize("cells", [1, 12])
def test_shadows_keep_their_edges(device, cells):
    """Dark stripes of one cell and of more, far finer than a block: they neither go nor spread."""
    share = on_wall(lambda row: np.where(row % 32 < cells, 200, 400), device)
    assert share.max() < 1e-4


@pytest.mark.parametrize("metallic", [0.0, 0.6, 1.0])
def test_gloss_is_the_oracles(device, metallic):
    """Metals of every roughness under a sky, dimmed where baked light is below the open sky's."""
    triangles = np.concatenate([soup(60, 3, 0.5), WALL[:2]])
    colour = (0.9, 0.6, 0.3)
    world = replace(
        baked(triangles, 4),
        materials=[Material(f"{k}", colour, metallic=metallic, roughness=k / 8) for k in range(9)],
        material_ids=np.arange(len(triangles), dtype=np.int32) % 9,
    )
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


def test_metal_under_a_sky_without_baked_light_reflects_ambient_light(device):
    metal = lfcore.Surface("metal", (0.8, 0.5, 0.2), metallic=1.0, roughness=0.5)
    corners = [[[-9, -9, 2], [9, -9, 2], [0, 9, 2]]]
    plain = lfcore.Scene.from_triangles(corners, surface=metal, ambient=(0.3, 0.3, 0.3))
    sky = replace(plain, sky=np.full((4, 4, 3), 2, np.float32))
    rays = bundles.views(Slab(plain.camera, 1, 16), np.array([[0, 0]]))
    expected, found = (tracer_of(one, device).bundle_radiance(rays) for one in (plain, sky))
    hit = (found != 2).any(-1)  # the rest shows the sky
    assert hit[0, 8, 8] and expected[hit].min() > 0.03
    np.testing.assert_array_equal(found[hit], expected[hit])


def test_a_scene_at_another_instant_keeps_textures_and_light_on_the_device(device, monkeypatch):
    kept, pack = [], device_scene.pack_surfaces

    def packed(*words, left_out, **named):
        kept.append(set(left_out))
        return pack(*words, left_out=left_out, **named)

    monkeypatch.setattr(device_scene, "pack_surfaces", packed)
    texture = np.random.default_rng(2).integers(0, 256, (8, 8, 3)).astype(np.uint8)
    for world in (curved([SUN], texture=texture), baked(soup(40, 3))):
        moved = replace(world, triangles=world.triangles + np.float32([0.01, 0, 0.02]))
        before, tree = tracer_of(world, device), build_bvh(moved.triangles)
        kept.clear()
        now, alone = (
            Tracer(moved, tree, device, before.needs, mipmaps=False, before=each)
            for each in (before, None)
        )
        rays = bundles.views(Slab(CAMERA, 2, 32), np.array([[0, 0], [1, 1]]))
        np.testing.assert_array_equal(now.bundle_radiance(rays), alone.bundle_radiance(rays))
        assert kept[0] >= ({"grids", "baked_light"} if world.light else {"mip_levels", "texels"})
        assert not kept[1]
