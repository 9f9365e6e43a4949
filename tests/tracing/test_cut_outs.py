"""Holes that the alpha of textures cuts, in what is seen and in shadows, against float64."""

import dataclasses

import numpy as np
import pytest
from tracing_scenes import CAMERA, WALL, scene, slab_colours, tracer_of, unit

from lfcore.optics.bundles import macropixels, views
from lfcore.optics.slab import Slab
from lfcore.oracle.cut_outs import solid_of
from lfcore.oracle.intersect import closest_hits
from lfcore.oracle.slab import all_pixels, slab_hits, trace
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light, Material
from lfcore.scene.needs import Needs

pytestmark = pytest.mark.kernels

LAMP = Light(POINT, (0.6, -1.5, 0.5), (0.9, 0.8, 0.7))
SUN = Light(DIRECTIONAL, unit(-0.15, -0.25, -0.95), (0.7, 0.7, 0.7))


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
    assert Needs.of(world).cut_outs and not Needs.of(solid).cut_outs
    assert (tracer_of(solid, device).closest_hit(origins, directions)[1] == 1).all()


@pytest.mark.parametrize("outer", [1, 2, 4, "single rays"])
def test_hits_are_the_oracles(device, outer):
    world, slab = curtains(), Slab(CAMERA, 20, 24)
    options = {"single_rays": True} if outer == "single rays" else {"outer": outer}
    tracer = tracer_of(world, device, **options)
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
    rays = macropixels(slab, all_pixels(slab))
    origins, directions = (a.reshape(-1, 3).astype(np.float32) for a in rays.rays())
    single, distance, _ = tracer.closest_hit(origins, directions)
    truth = closest_hits(world.triangles, origins, directions, solid=solid_of(world))
    assert (single != truth.triangle).mean() < 1e-4
    triangle, depth = tracer.bundle_hits(rays, all_pixels(slab))
    assert (single != triangle.ravel()).mean() < 1e-4
    same = single == triangle.ravel()
    assert np.abs(distance[same] / depth.ravel()[same] - 1).max() < 1e-5
    seen, _ = tracer.bundle_hits(views(slab, all_pixels(Slab(CAMERA, 16, 16))))
    assert (seen.transpose(1, 2, 0).ravel() != triangle.ravel()).mean() < 1e-4


@pytest.mark.parametrize("outer", [1, 4, "single rays"])
@pytest.mark.parametrize("light", [LAMP, SUN], ids=["lamp", "sun"])
def test_shadows_have_the_holes_of_what_casts_them(device, outer, light):
    world, slab = curtains(lights=[light]), Slab(CAMERA, 16, 8)
    options = {"single_rays": True} if outer == "single rays" else {"outer": outer}
    found, expected = slab_colours(world, slab, device, **options)
    opaque = dataclasses.replace(world, materials=[Material("x", texture=0)] * 2)
    shadowed = trace(opaque, slab, all_pixels(slab)).reshape(found.shape)
    assert (np.abs(shadowed - expected).max(-1) > 0.01).mean() > 0.2
    assert (np.abs(np.clip(found, 0, 1) - expected).max(-1) > 0.01).mean() < 1e-3
