"""Metal and roughness, bent normals, textures that glow, and holes that the alpha of textures cuts,
against float64."""

import dataclasses

import numpy as np
import pytest
from plain_scenes import wall
from tracing_scenes import (
    CAMERA,
    LAMP,
    SUN,
    WALL,
    bent_normals,
    every_ray,
    oracle_colours,
    scene,
    slab_colours,
    tracer_of,
    unit,
)

from lfcore import Camera, Slab
from lfcore.optics.bundles import views
from lfcore.oracle import metal
from lfcore.oracle.intersect import closest_hits
from lfcore.oracle.slab import all_pixels, slab_hits
from lfcore.oracle.textures import solid_of
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light, Material
from lfcore.scene.needs import Needs

pytestmark = pytest.mark.kernels


def maps():
    """Base, metal and roughness, normals, glow: smooth pictures, of sizes of their own."""
    rng = np.random.default_rng(7)

    def smooth(height, width, low, high):
        y, x = np.mgrid[0 : 1 : 1j * height, 0 : 1 : 1j * width] * 2 * np.pi
        turn = rng.uniform(0, 6, (3, 2))
        waves = np.stack([np.sin(x + a) * np.cos(y + b) for a, b in turn], -1) / 2 + 0.5
        return np.rint(255 * (low + (high - low) * waves)).astype(np.uint8)

    normals = smooth(16, 32, 0.2, 0.8)
    normals[..., 2] = 220
    return [smooth(24, 20, 0.2, 0.9), smooth(12, 12, 0.1, 0.9), normals, smooth(9, 9, 0.0, 1.0)]


MAPS = {"texture": 0, "metal_texture": 1, "normal_texture": 2, "emission_texture": 3}
METAL = {"metallic": 0.9, "roughness": 0.8, "normal_scale": 0.7}
MATERIALS = {
    "factors": [Material("a", (0.7, 0.5, 0.3), metallic=0.6, roughness=0.4, texture=0)],
    "smooth metal": [Material("a", (0.9, 0.7, 0.3), metallic=1.0, roughness=0.1, texture=0)],
    "maps": [
        Material("a", (0.9, 0.8, 0.7), emission=(0.1, 0.2, 0.1), **METAL, **MAPS),
        Material("b", (0.7, 0.6, 0.5), (0.3, 0.3, 0.3), 20.0, texture=0),
        Material("c", (0.7, 0.6, 0.5), (0.3, 0.3, 0.3), 20.0, normal_texture=2),
    ],
}


def sheets(materials, lights=(LAMP, SUN), *, smooth=True, count=18):
    """Triangles every way round before a wall, their texture coordinates mirrored on some."""
    rng = np.random.default_rng(4)
    middles = rng.uniform([-0.7, -0.7, 1.5], [0.7, 0.7, 4.0], (count, 1, 3))
    triangles = np.concatenate([middles + rng.normal(size=(count, 3, 3)) * 0.4, WALL])
    normals = bent_normals(triangles, rng, 0.15)
    return scene(
        triangles,
        normals=normals if smooth else np.zeros((0, 3, 3), np.float32),
        uvs=rng.uniform(0, 1.5, (len(triangles), 3, 2)).astype(np.float32),
        textures=maps(),
        materials=materials,
        material_ids=(np.arange(len(triangles)) % len(materials)).astype(np.int32),
        lights=list(lights),
        ambient=(0.1, 0.15, 0.2),
    )


@pytest.mark.parametrize(
    ("name", "spanning", "smooth"),
    [*((name, False, True) for name in MATERIALS), ("maps", False, False), ("maps", True, True)],
)
def test_colours_are_the_oracles(device, name, spanning, smooth):
    world = sheets(MATERIALS[name], smooth=smooth)
    found, expected = slab_colours(world, Slab(CAMERA, 16, 8), device, spanning=spanning)
    assert np.ptp(expected) > 0.3
    difference = np.abs(np.clip(found, 0, 1) - expected).max(-1)
    # Texels are held to half a 1023rd of their root, a thousandth of their value.
    assert (difference > 2e-3).mean() < 2e-3 and np.median(difference) < 5e-4


def test_light_straight_from_behind_adds_nothing(device):
    light = Light(DIRECTIONAL, (0.0, 0.0, 1.0), (0.9, 0.9, 0.9), 0.0, False)
    rays = every_ray(Slab(CAMERA, 16, 4))
    dark = sheets(
        [Material("a", (0.5,) * 3, metallic=0.5, texture=0)], [SUN], smooth=False, count=0
    )
    lit = dataclasses.replace(dark, lights=[SUN, light])
    found = (tracer_of(world, device).bundle_radiance(rays) for world in (dark, lit))
    np.testing.assert_array_equal(*found)


@pytest.mark.parametrize("shape", [{}, {"normal": (0.0, 0.0, -1.0)}, {"cone": (1.0, 0.9)}])
@pytest.mark.parametrize("first", [0, 1])
def test_a_light_on_the_surface_is_finite(device, first, shape):
    """The middle ray hits the light itself, at no distance."""
    if "cone" in shape:
        shape = {"normal": (0.0, 0.0, 1.0), **shape}
    lamp = Light(POINT, (0.0, 0.0, 4.0), (0.9, 0.9, 0.9), 2.0, False, **shape)
    materials = MATERIALS["maps"][first : first + 2]
    world = sheets(materials, (lamp, SUN), smooth=False, count=0)
    exact = Camera(0.5, 0.3125, 1.0, np.inf)  # all numbers of its rays are without rounding
    world = dataclasses.replace(world, triangles=wall(4.0, 8.0), clip=False, camera=exact)
    found, expected = slab_colours(world, Slab(exact, 1, 5), device, spanning=False)
    assert np.isfinite(found).all() and np.isfinite(expected).all()
    middle = len(found) // 2
    np.testing.assert_allclose(found[middle], expected[middle], atol=2e-3)


def test_what_asks_for_metal_alone_pays_for_it():
    plain = sheets([Material("a", texture=0)])
    assert not Needs.of(plain).physical
    for changes in ({"metallic": 0.0}, {"normal_texture": 2}, {"emission_texture": 3}):
        assert Needs.of(dataclasses.replace(plain, materials=[Material("a", **changes)])).physical


def test_a_bump_is_lit_from_its_side(device):
    """Red grows to where u does and green to where v does, up: a light there finds it bright."""
    corners = np.float32([[-2, 2, 2], [2, 2, 2], [2, -2, 2], [-2, -2, 2]])  # counter-clockwise
    uv = np.float32([[0, 0], [1, 0], [1, 1], [0, 1]])
    faces = [[0, 1, 2], [0, 2, 3]]
    rays = every_ray(Slab(CAMERA, 16, 1))
    sides = {"right": (1, 0), "left": (-1, 0), "above": (0, -1), "below": (0, 1)}
    for code, bright in (((255, 128), "right"), ((0, 128), "left"), ((128, 255), "above")):
        for turned in (False, True):
            picture = np.full((2, 2, 3), 128, np.uint8)
            picture[..., 0], picture[..., 1] = code
            order = [f[::-1] for f in faces] if turned else faces
            seen = {}
            for side, (x, y) in sides.items():
                light = Light(DIRECTIONAL, unit(x, y, -1.0), (1.0, 1.0, 1.0))
                world = scene(
                    corners[order], uvs=uv[order], textures=[picture], lights=[light],
                    materials=[Material("m", (0.5,) * 3, normal_texture=0)], ambient=(0.0,) * 3,
                )  # fmt: skip
                seen[side] = tracer_of(world, device, spanning=False).bundle_radiance(rays).mean()
            opposite = {"right": "left", "left": "right", "above": "below"}[bright]
            # From behind, what bulges is a hollow.
            assert max(seen, key=seen.__getitem__) == (opposite if turned else bright)


def test_what_the_oracle_gives_back():
    """Over all directions to the light; glTF's mix of the two gives 8% too much when grazing."""
    steps = (np.arange(300) + 0.5) / 300
    z, turn = (axis.ravel() for axis in np.meshgrid(steps, 2 * np.pi * steps))
    ring = np.sqrt(1 - z**2)
    towards = np.stack([ring * np.cos(turn), ring * np.sin(turn), z], 1)
    normal = np.tile([0.0, 0.0, 1.0], (len(z), 1))
    for roughness in (0.3, 0.6, 1.0):
        for metallic, base in ((1.0, 1.0), (0.0, 1.0), (0.0, 0.0)):
            one = np.ones((len(z), 1))
            surface = metal.Metals(base * np.ones((len(z), 3)), metallic * one, roughness * one)
            for tilt in (0.1, 1.2):
                view = np.tile([np.sin(tilt), 0.0, np.cos(tilt)], (len(z), 1))
                # The mean over the hemisphere of pi f cos, times 2 pi / pi.
                back = 2 * sum(surface.reflected(normal, towards, view)).mean()
                assert 0.01 < back < (1 if metallic else 1.09)
    rough = metal.Metals(np.full((1, 3), 0.5), np.zeros((1, 1)), np.ones((1, 1)))
    straight = sum(rough.reflected(normal[:1], normal[:1], normal[:1]))
    # Looked at and lit straight: F = 0.04, D = 1 / pi, V = 1 / 4.
    np.testing.assert_allclose(straight, 0.96 * 0.5 + 0.04 / 4)


def lace():
    """A smooth picture that is a hole in places, and is grey everywhere."""
    y, x = np.mgrid[0:1:24j, 0:1:20j]
    alpha = 0.5 + 0.35 * np.sin(2 * np.pi * 2 * x) * np.cos(2 * np.pi * 3 * y) + 0.1 * x
    codes = np.rint(255 * alpha).astype(np.uint8)
    return np.dstack([np.full((24, 20, 3), 188, np.uint8), codes])


def curtains(cutoff=0.5, count=24, lights=()):
    """Large triangles of lace before a wall of the same picture that is whole."""
    rng = np.random.default_rng(2)
    middles = rng.uniform([-0.7, -0.7, 1.5], [0.7, 0.7, 4.0], (count, 1, 3))
    triangles = np.concatenate([middles + rng.normal(size=(count, 3, 3)) * 0.35, WALL])
    coordinates = rng.uniform(-1, 2, (len(triangles), 3, 2)).astype(np.float32)
    ids = np.zeros(len(triangles), np.int32)
    ids[-2:], ids[: count // 4] = 1, 1
    return scene(
        triangles,
        uvs=coordinates,
        textures=[lace()],
        material_ids=ids,
        materials=[
            Material("lace", (0.8, 0.7, 0.6), texture=0, alpha_cutoff=cutoff),
            Material("whole", (0.5, 0.5, 0.5), texture=0),
        ],
        lights=list(lights),
    )


def test_a_hole_shows_what_lies_behind(device):
    """Half of a square is cut out: rays that meet it there meet the wall."""
    texture = np.full((2, 8, 4), 255, np.uint8)
    texture[:, :4, 3] = 0
    p, q, r, s = np.float32([[-1, -1, 2], [1, -1, 2], [1, 1, 2], [-1, 1, 2]])
    square, uv = np.stack([[p, q, r], [p, r, s]]), np.float32([[0, 0], [1, 0], [1, 1], [0, 1]])
    triangles = np.concatenate([square, WALL])
    coordinates = np.zeros((4, 3, 2), np.float32)
    coordinates[:2] = uv[[[0, 1, 2], [0, 2, 3]]]
    materials = [Material("cut", texture=0, alpha_cutoff=0.5), Material("wall")]
    world = scene(triangles, uvs=coordinates, textures=[texture], materials=materials,
                  material_ids=np.int32([0, 0, 1, 1]))  # fmt: skip
    x = np.float32([-0.9, -0.5, -0.1, 0.1, 0.5, 0.9])
    directions = np.stack([x, np.full(6, 0.3), np.full(6, 2.0)], 1).astype(np.float32)
    origins = np.zeros_like(directions)
    found, distance, _ = tracer_of(world, device).closest_hit(origins, directions)
    np.testing.assert_array_equal(distance, [2.5, 2.5, 2.5, 1, 1, 1])
    assert (found[:3] >= 2).all() and (found[3:] < 2).all()
    solid = dataclasses.replace(world, materials=[Material("solid", texture=0), materials[1]])
    assert Needs.of(world).alpha_tests and not Needs.of(solid).alpha_tests
    assert (tracer_of(solid, device).closest_hit(origins, directions)[1] == 1).all()


WAYS = [{"spanning": False}, {"spanning": True}, {"single_rays": True}]


@pytest.mark.parametrize("way", WAYS, ids=str)
def test_hits_are_the_oracles(device, way):
    world, slab = curtains(), Slab(CAMERA, 20, 24)
    tracer = tracer_of(world, device, **way)
    pixels = np.stack(np.meshgrid([3, 4, 11, 12], [7, 8, 15, 16]), -1).reshape(-1, 2)
    triangle, depth = tracer.slab_hits(slab, pixels)
    truth = slab_hits(world, slab, pixels)
    whole = slab_hits(dataclasses.replace(world, materials=[Material("x")] * 2), slab, pixels)
    assert 0.1 < (truth.triangle != whole.triangle).mean() < 0.9
    differ = triangle.ravel() != truth.triangle
    assert differ.mean() < 2e-4  # rays at the rim of a hole, or at an edge
    assert np.abs(depth.ravel()[~differ] / truth.t[~differ] - 1).max() < 1e-5


def test_all_kinds_of_rays_agree(device):
    world, slab = curtains(), Slab(CAMERA, 16, 16)
    tracer = tracer_of(world, device)
    rays = every_ray(slab)
    origins, directions = (a.reshape(-1, 3).astype(np.float32) for a in rays.rays())
    single, distance, _ = tracer.closest_hit(origins, directions)
    truth = closest_hits(world.triangles, origins, directions, solid=solid_of(world))
    assert (single != truth.triangle).mean() < 1e-4
    triangle, depth = tracer.bundle_hits(rays, all_pixels(slab))
    assert (single != triangle.ravel()).mean() < 1e-4
    same = single == triangle.ravel()
    assert np.abs(distance[same] / depth.ravel()[same] - 1).max() < 1e-5
    seen, _ = tracer.bundle_hits(views(slab, all_pixels(slab)))
    assert (seen.transpose(1, 2, 0).ravel() != triangle.ravel()).mean() < 1e-4


@pytest.fixture(scope="module", params=[LAMP, SUN], ids=["lamp", "sun"])
def lit(request):
    """Curtains in a light, rays, and their colours by the oracle."""
    world, rays = curtains(lights=[request.param]), every_ray(Slab(CAMERA, 16, 8))
    opaque = dataclasses.replace(world, materials=[Material("x", texture=0)] * 2)
    expected, shadowed = (oracle_colours(each, rays) for each in (world, opaque))
    assert (np.abs(shadowed - expected).max(-1) > 0.01).mean() > 0.2
    return world, rays, expected


@pytest.mark.parametrize("way", WAYS, ids=str)
def test_shadows_have_the_holes_of_what_casts_them(device, way, lit):
    world, rays, expected = lit
    found = tracer_of(world, device, **way).bundle_radiance(rays).reshape(-1, 3)
    assert (np.abs(np.clip(found, 0, 1) - expected).max(-1) > 0.01).mean() < 1e-3
