"""Rays given one by one: their light and surfaces are the oracle's, by the code of camera rays."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from test_materials import MATERIALS, sheets
from tracing_scenes import LAMP, SUN, WALL, baked, curved, soup, tracer_of

import lfcore
from lfcore import Slab
from lfcore.errors import OpticsError
from lfcore.optics import bundles
from lfcore.oracle import shading
from lfcore.oracle.intersect import closest_hits
from lfcore.oracle.metal import bent_normals, metals
from lfcore.oracle.textures import Spots, solid_of
from lfcore.scene.appearance import Material
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer


def sky_and_metal():
    """Metals in baked light, and a sky on all sides."""
    triangles = np.concatenate([soup(60, 3, 0.5), WALL])
    colour = (0.9, 0.6, 0.3)
    return replace(
        baked(triangles, 4),
        materials=[Material(f"{k}", colour, metallic=k / 4, roughness=k / 4) for k in range(5)],
        material_ids=np.arange(len(triangles), dtype=np.int32) % 5,
    )


def curved_soup():
    world = curved([LAMP, SUN])
    return replace(world, materials=[replace(world.materials[0], curved=True)])


WORLDS = {
    "maps": lambda: sheets(MATERIALS["maps"]),
    "flat maps": lambda: sheets(MATERIALS["maps"], smooth=False),
    "sky": sky_and_metal,
    "curved": curved_soup,
}
MAPPED = pytest.mark.parametrize("smooth", [True, False])


def any_rays(count=600, seed=6):
    """Rays from anywhere to anywhere, of unlike length."""
    origins, ends = np.random.default_rng(seed).random((2, count, 3)) * [2, 2, 4] - [1, 1, 0]
    return origins.astype(np.float32), (ends - origins).astype(np.float32)


def camera_rays(world, views=3, pixels=24):
    return bundles.views(Slab(world.camera, views, pixels), np.array([[0, 0], [2, 1]]))


def listed(rays):
    return tuple(part.reshape(-1, 3).astype(np.float32) for part in rays.rays())


@pytest.mark.kernels
@pytest.mark.parametrize("name", WORLDS)
def test_light_of_rays_from_anywhere_is_the_oracles(device, name):
    world, rays = WORLDS[name](), any_rays()
    tracer = tracer_of(world, device)
    hits = tracer.closest_hit(*rays)
    assert 0.2 < (hits.triangle >= 0).mean() < 0.9
    found, expected = tracer.hit_radiance(*rays, hits), shading.radiance(world, *rays)
    assert np.ptp(expected) > 0.3
    off = np.abs(np.clip(found, 0, 1 if world.clip else np.inf) - expected).max(-1)
    # Texels are held to half a 1023rd of their root; highlights amplify it.
    assert (off > 2e-3).mean() < 0.02 and off.max() < 0.02 and np.median(off) < 2e-4


@pytest.mark.kernels
@pytest.mark.parametrize("name", WORLDS)
def test_given_rays_have_the_light_of_the_cameras(device, name):
    world = WORLDS[name]()
    tracer, rays = tracer_of(world, device), camera_rays(world)
    given = listed(rays)
    found = tracer.hit_radiance(*given, tracer.closest_hit(*given))
    np.testing.assert_allclose(found, tracer.bundle_radiance(rays).reshape(-1, 3), atol=2e-5)


def true_surfaces(world, origins, directions):
    """Emission, albedo and normals of the oracle, and the mask of hits."""
    hits = closest_hits(world.triangles, origins, directions, solid=solid_of(world))
    on = hits.triangle >= 0
    view = -directions[on] / np.linalg.norm(directions[on], axis=1, keepdims=True)
    spots = Spots(world, hits.triangle[on], hits.weights[on], view.astype(np.float64))
    emission = spots.of_material("emission") * spots.sampled("emission_texture", encoded=True)
    albedo, normal = shading.albedo(spots), shading.normals(spots)
    is_metal = spots.of_material("metallic")[:, None] >= 0
    albedo = np.where(is_metal, metals(spots, albedo).surrounded(), albedo)
    return (emission, albedo, bent_normals(spots, normal)), on


@pytest.mark.kernels
@MAPPED
@pytest.mark.parametrize("kind", ["given", "camera"])
def test_surfaces_are_the_oracles(device, kind, smooth):
    world = sheets(MATERIALS["maps"], smooth=smooth)
    tracer, rays = tracer_of(world, device), any_rays()
    if kind == "given":
        found = tracer.hit_surfaces(*rays, tracer.closest_hit(*rays))
    else:
        found, rays = tracer.bundle_surfaces(camera_rays(world)), listed(camera_rays(world))
    expected, on = true_surfaces(world, *rays)
    for values, true, missed in zip(found, expected, (world.background, 0, 0), strict=True):
        values = values.reshape(-1, 3)
        off = np.abs(values[on] - true).max(-1)
        assert np.ptp(true) > 0.1 and (off > 5e-3).mean() < 5e-3 and np.median(off) < 5e-4
        np.testing.assert_allclose(values[~on], np.broadcast_to(missed, values[~on].shape))


@pytest.mark.kernels
def test_widths_choose_the_mip_level_that_a_pixel_does(device):
    world = sheets(MATERIALS["maps"])
    tracer = Tracer(world, build_bvh(world.triangles), device)
    rays = replace(camera_rays(world, 2, 8), pixel_pitch=0.5)
    given = listed(rays)
    hits = tracer.closest_hit(*given)
    length = np.linalg.norm(given[1], axis=1)
    widths = np.where(hits.triangle < 0, 0, hits.distance * length * np.float32(0.5))
    camera = tracer.bundle_radiance(rays).reshape(-1, 3)

    def off(filtered):
        return np.abs(tracer.hit_radiance(*given, hits, filtered=filtered) - camera).mean()

    # Blocks choose the level at their centre.
    assert off(0.5) < off(0.0) / 4 and off(widths) < off(0.0) / 4


def test_what_is_no_hit_of_these_rays_is_refused(device):
    world = curved_soup()
    tracer, rays = tracer_of(world, device), any_rays(5)
    hits = tracer.closest_hit(*rays)
    bad = [
        (hits._replace(triangle=hits.triangle + len(world.triangles)), 0.0),
        (hits._replace(triangle=hits.triangle[1:]), 0.0),
        (hits._replace(barycentric=hits.barycentric[:, :2]), 0.0),
        (hits, np.zeros(3, np.float32)),
    ]
    for wrong, filtered in bad:
        with pytest.raises(OpticsError):
            tracer.hit_surfaces(*rays, wrong, filtered=filtered)
    none = np.zeros((0, 3), np.float32)
    assert tracer.hit_radiance(none, none, tracer.closest_hit(none, none)).shape == (0, 3)


def test_shading_knows_neither_blocks_nor_plane_equations():
    """It reads the record of hits alone, whatever the rays."""
    folders = [Path(lfcore.__file__).parent / "tracing/kernels", Path(lfcore.__file__).parent]
    files = {path.name: path for folder in folders for path in folder.rglob("*.cl")}
    left, read = ["shade.cl"], set()
    while left:
        name = left.pop()
        read.add(name)
        left += set(re.findall(r'#include "(.+)"', files[name].read_text())) - read
    assert "hits.cl" in read
    assert not read & {"block.cl", "equations.cl", "visibility.cl", "packet.cl", "walk.cl"}
