"""Baked light: closed forms, bounces, skies, bad input."""

import itertools
from dataclasses import replace
from functools import partial

import numpy as np
import plain_scenes
import pytest
import trimesh

import lfcore
from lfcore import BakedLight, BakeOptions, Material, Scene, open_device
from lfcore.baking.denoising import denoised
from lfcore.baking.emitters import Emitters
from lfcore.baking.gather import Gatherer
from lfcore.baking.mesh_colours import Points, lattice
from lfcore.baking.sampling import directions, samples
from lfcore.baking.surroundings import Surroundings
from lfcore.optics import bundles
from lfcore.oracle import shading
from lfcore.oracle.intersect import closest_hits
from lfcore.oracle.metal import metals
from lfcore.oracle.textures import Spots
from lfcore.rendering.prepared import open_tracer
from lfcore.scene.appearance import POINT, Light
from lfcore.scene.baked import NO_SKY
from lfcore.scene.sky import (
    octahedral,
    panorama_places,
    radiance,
    solid_angles,
    suns,
    texel_directions,
    under,
)
from lfcore.scene.surface_mesh import grid_triangles
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer

pytestmark = pytest.mark.kernels
WHITE = np.ones((2, 2, 3), np.float32)


def world(triangles, albedo=0.5, emission=0.0, sky=WHITE, **options):
    """A matt scene before a pinhole, lit by its sky alone."""
    material = Material("matt", (albedo,) * 3, emission=(emission,) * 3)
    lens = replace(plain_scenes.CAMERA, f_number=1e4)
    return plain_scenes.scene(
        triangles, materials=[material], sky=sky, bake=BakeOptions(**options), camera=lens
    )


def seen(scene, pixels=48):
    slab = lfcore.Slab(scene.camera, 1, pixels)
    return open_tracer(scene).bundle_radiance(bundles.views(slab, np.int32([[0, 0]])))[0]


def on_grid(scene, triangle, behind):
    """Places of a triangle's baked points (n, 3) that the camera sees, and their light (n,)."""
    light = scene.light
    first, side = light.grids[triangle, int(behind)], light.grids[triangle, 2]
    at = lattice(int(side))
    weights = np.column_stack([side - at.sum(1), at]) / side
    places, found = weights @ scene.triangles[triangle], light.values[first : first + len(at), 0]
    in_view = (2 * abs(places[:, :2]) < scene.camera.field_width * places[:, 2:]).all(1)
    return places[in_view], found[in_view]


def rectangle(low, high, z):
    """Two triangles across the axis, from (x, y) ``low`` to ``high``."""
    (a, b), (c, d) = low, high
    corners = np.array([[a, b, z], [c, b, z], [c, d, z], [a, d, z]])
    return corners[[[0, 1, 2], [0, 2, 3]]]


def factor_to(places, low, high, distance):
    """The share of a parallel rectangle in the light of places (n, 3) across the axis: J. Howell,
    "A Catalog of Radiation Heat Transfer Configuration Factors", B-4."""
    total = 0.0
    for sign, x in ((-1, low[0]), (1, high[0])):
        for turn, y in ((-1, low[1]), (1, high[1])):
            a, b = (x - places[:, 0]) / distance, (y - places[:, 1]) / distance
            c, d = np.sqrt(1 + a * a), np.sqrt(1 + b * b)
            part = a / c * np.arctan(b / c) + b / d * np.arctan(a / d)
            total = total + sign * turn * part / (2 * np.pi)
    return total


def solid(kind, at, **size):
    mesh = getattr(trimesh.creation, kind)(**size)
    return mesh.apply_translation(at).triangles


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e4])
def test_a_furnace_shows_nothing(size):
    """What glows with half of what is all around, and reflects half, looks as all around."""
    things = [solid("icosphere", (0, 0, 2), subdivisions=2, radius=0.3),
              solid("box", (0.4, 0.1, 2.2), extents=(0.5, 0.5, 0.5))]  # fmt: skip
    scene = world(size * np.concatenate(things), 0.5, 0.5, bounces=8)
    lens = replace(
        scene.camera, focus_m=2 * size, focal_length_m=0.05 * size, sensor_width_m=0.036 * size
    )
    assert abs(seen(replace(scene, camera=lens)) - 1).max() < 0.005


@pytest.mark.parametrize(("subdivisions", "cells"), [(4, 32), (5, 8)])
def test_a_sphere_in_half_a_sky(subdivisions, cells):
    """A place whose normal is at an angle a to the bright half gets (1 + cos a) / 2; faces that are
    small beside cells share points."""
    towards = texel_directions(64)
    sky = np.repeat(np.float32(towards[..., 1:2] < 0), 3, axis=-1)
    ball = solid("icosphere", (0, 0, 2), subdivisions=subdivisions, radius=0.3)
    normals = (ball - (0, 0, 2)) / 0.3
    scene = replace(world(ball, 1.0, sky=sky, bounces=0), normals=np.float32(normals))
    baked = lfcore.bake(scene, error=0.01, cells=cells).light
    first, side = baked.grids[:, 0], baked.grids[:, 2]
    for corner, offset in enumerate([0 * side, side, (side + 1) * (side + 2) // 2 - 1]):
        wanted = (1 - normals[:, corner, 1]) / 2
        front = ball.mean(1)[:, 2] < 1.9
        off = (baked.values[first + offset, 1] - wanted)[front]
        assert abs(off.mean()) < 0.002 and np.sqrt((off**2).mean()) < 0.01


@pytest.mark.parametrize("up", [0.5, 0.0, -0.5])
def test_a_normal_map_turns_surfaces_to_the_sky(up):
    """A wall under the upper half of a sky has (1 + sin a) / 2, turned upward by a."""
    sky = np.repeat(np.float32(texel_directions(64)[..., 1:2] < 0), 3, axis=-1)
    walls = plain_scenes.wall(1.5, 2.0)[:, ::-1]  # seen from the front
    normal = np.array([0, up, np.sqrt(1 - up * up)])
    scene = replace(
        world(walls, sky=sky, bounces=0, error=0.02),
        materials=[Material("bumpy", (1.0,) * 3, normal_texture=0)],
        textures=[np.tile(np.uint8(np.rint((normal / 2 + 0.5) * 255)), (4, 4, 1))],
        uvs=np.float32((walls[..., :2] * (1, -1) + 2) / 4),
    )
    assert seen(scene, 16).mean() == pytest.approx((1 + up) / 2, rel=0.03)


@pytest.mark.parametrize(("half", "distance"), [(0.01, 1.8), (0.2, 1.8), (0.5, 1.0)])
def test_what_glows_gives_what_its_form_factor_says(half, distance):
    """A square, small behind the camera or a plate as wide as half of the wall before it."""
    low, high = (0.4 - half, -half), (0.4 + half, half)  # leaves some of the wall in the picture
    scene = replace(
        world(np.concatenate([plain_scenes.wall(1.5, 1.0), rectangle(low, high, 1.5 - distance)])),
        materials=[Material("matt"), Material("lamp", emission=(0.1 / half**2,) * 3)],
        material_ids=np.int32([0, 0, 1, 1]), sky=np.zeros_like(WHITE),
        bake=BakeOptions(0, error=0.005),
    )  # fmt: skip
    scene = lfcore.bake(scene)
    for triangle in (0, 1):
        places, found = on_grid(scene, triangle, behind=True)
        wanted = 0.1 / half**2 * factor_to(places, low, high, distance)
        off = found / wanted - 1
        assert abs(off.mean()) < 0.003 and np.sqrt((off**2).mean()) < 0.01


def test_rays_grow_with_surface_in_the_picture():
    """Of a plate before a wall, of which the camera sees all, or a small part."""

    def rays(half):
        things = plain_scenes.wall(1.5, half), rectangle((-0.2, -0.2), (0.2, 0.2), 1.4)
        return lfcore.bake(world(np.concatenate(things), bounces=1, error=0.03)).light.rays

    assert rays(2.8) < 2.5 * rays(0.7)  # with all of the wall as good, 4


@pytest.fixture
def caches(monkeypatch):
    """The irradiance caches of bakes."""
    found = []

    def kept(cache):
        found.append(cache)
        return denoised(cache)

    monkeypatch.setattr("lfcore.baking.bake.denoised", kept)
    return found


def test_points_do_not_grow_with_the_number_of_small_faces(caches, monkeypatch):
    monkeypatch.setattr("lfcore.baking.bake.FINEST", 1)
    for number in (64, 128):
        places = np.stack(np.meshgrid(*[np.linspace(-1, 1, number + 1)] * 2), -1)
        wall = np.concatenate([places, np.full_like(places[..., :1], 1.5)], -1)
        lfcore.bake(world(grid_triangles(wall), bounces=0, error=0.3, cells=8))
    few, many = (len(cache.grids.points) for cache in caches)
    assert many < 1.5 * few


def test_every_point_sends_rays(caches, monkeypatch):
    """Also where faces are left that no round of rays reached."""
    monkeypatch.setattr("lfcore.baking.irradiance_cache._ROUNDS", 1)
    things = solid("box", (0, 0, 2), extents=(0.5, 0.5, 0.5)), plain_scenes.wall(2.5)[:, ::-1]
    lfcore.bake(world(np.concatenate(things), error=0.3, cells=4))
    assert caches[0].counts.min() > 0


@pytest.mark.parametrize("metallic", [-1.0, 0.7])
def test_gather_rays_are_the_hosts_and_bring_the_oracles_light(metallic):
    """Of textured and tinted walls that glow, under a sky, ray by ray."""
    random = np.random.default_rng(3)
    walls = np.concatenate([plain_scenes.wall(1.5, 1.0), plain_scenes.wall(1.2, 0.3)])
    material = Material("matt", (0.5, 0.6, 0.7), emission=(0.3, 0.2, 0.1), texture=0,
                        emission_texture=1, metallic=metallic)  # fmt: skip
    scene = replace(
        world(walls, sky=np.float32(1 + texel_directions(16))),
        materials=[material],
        textures=[random.integers(0, 255, (4, 8, 3), np.uint8) for _ in range(2)],
        uvs=random.random((4, 3, 2), np.float32), colours=random.random((4, 3, 3), np.float32),
    )  # fmt: skip
    around, seeds, n = Surroundings(scene, build_bvh(walls), open_device()), np.arange(50), 32
    places = np.float32([0.1, 0.1, 1.3]) + 0.1 * random.random((50, 3), np.float32)
    up = np.tile(np.float32([0.6, 0, -0.8]), (50, 1)) * np.float32((-1) ** seeds)[:, None]
    points = Points(places, up, up, np.zeros(50))
    emitters = Emitters(around, points)
    gatherer = Gatherer(emitters, np.zeros(8, bool))
    sums, is_open, kept = gatherer.send(points, seeds, 0, n, -1)
    towards = directions(points, *samples(seeds, 0, n)).reshape(-1, 3)
    starts = around.starts(points, np.repeat(seeds, n), towards)
    hits = closest_hits(walls, starts, towards)
    on = hits.triangle >= 0
    assert 0.2 < on.mean() < 0.8
    view = -towards[on].astype(np.float64)
    spots = Spots(scene, hits.triangle[on], hits.weights[on], view)
    behind = (spots.face_normals() * view).sum(1) < 0
    np.testing.assert_array_equal(kept["face"] >= 0, on)
    np.testing.assert_array_equal(kept["face"][on], 2 * hits.triangle[on] + behind)
    np.testing.assert_allclose(kept["weights"].view(np.float16)[on], hits.weights[on], atol=1e-3)
    np.testing.assert_array_equal(is_open, ~on.reshape(-1, n).all(1))
    albedo = shading.albedo(spots)
    if metallic >= 0:
        albedo = metals(spots, albedo).surrounded()
    off = abs(kept["albedo"].view(np.float16)[on] - np.minimum(albedo, 1))
    assert off.max() < 3e-3
    # Emission that rays to emitters find, too, has the share of the balance heuristic.
    wanted = radiance(scene.sky, towards).astype(np.float64)
    cosine = np.maximum((points.normals[np.repeat(seeds, n)] * towards).sum(1), 0)[on]
    normal = spots.face_normals() / np.linalg.norm(spots.face_normals(), axis=1)[:, None]
    density = emitters.share * emitters.density[kept["face"][on]] * hits.t[on] ** 2
    share = cosine / (cosine + density / abs((normal * view).sum(1)))
    emission = spots.of_material("emission") * spots.sampled("emission_texture", encoded=True)
    wanted[on] = emission * share[:, None]
    found = sums.sum(0) - emitters.gather(points, seeds, 0, n).sum(0)
    np.testing.assert_allclose(found, wanted.reshape(-1, n, 3).sum(1), rtol=1e-3, atol=1e-3)
    assert abs(kept["emission"].view(np.float16) - wanted.mean(1)).max() < 2e-3


def test_a_bright_part_of_the_sky_gives_its_share():
    """10^4 times as bright as the rest, and too wide for a sun."""
    towards = texel_directions(128)
    bright = towards @ np.array([0.6, 0.0, -0.8]) > np.cos(0.12)
    sky = np.repeat(np.where(bright, 1e4, 1.0)[..., None], 3, -1).astype(np.float32)
    assert suns(sky)[1] == []
    scene = lfcore.bake(world(plain_scenes.wall(1.5, 1.0), sky=sky, bounces=0, error=0.01))
    wanted = (sky[..., 0] * solid_angles(128) * np.maximum(-towards[..., 2], 0)).sum() / np.pi
    off = on_grid(scene, 0, behind=True)[1] / wanted - 1
    assert abs(off.mean()) < 0.003 and np.sqrt((off**2).mean()) < 0.01


def test_a_slit_lights_a_closed_room_as_its_form_factor_says():
    low, high = (-0.3, 0.2), (0.3, 0.3)
    front = [((-1, -1), (low[0], 1)), ((high[0], -1), (1, 1)),
             ((low[0], -1), (high[0], low[1])), ((low[0], high[1]), (high[0], 1))]  # fmt: skip
    things = [plain_scenes.wall(1.5, 1.0), *(rectangle(*part, -0.5) for part in front)]
    for side in (-1, 1):
        wall = rectangle((-1, -0.5), (1, 1.5), side)
        things += [wall[..., [2, 0, 1]], wall[..., [0, 2, 1]]]
    scene = lfcore.bake(world(np.concatenate(things), albedo=0.0, bounces=0, error=0.05))
    places, found = on_grid(scene, 0, behind=True)
    wanted = factor_to(places, low, high, 2.0)
    assert found.mean() == pytest.approx(wanted.mean(), rel=0.01)
    off = (found - wanted) / np.maximum(wanted, 0.25 * wanted.mean())
    # Linear between points, the picture has half of the variance of their noise.
    assert np.sqrt((off**2).mean() / 2) < 1.5 * scene.light.error


def closed_room(albedo, bounces):
    """A sphere, seen from its middle, that emits 1 and reflects a share."""
    room = solid("icosphere", (0, 0, 0), subdivisions=2, radius=3.0)
    dark = np.zeros_like(WHITE)
    return lfcore.bake(world(room, albedo, 1.0, sky=dark, bounces=bounces, cells=8))


@pytest.mark.parametrize(("albedo", "bounces"), [(0.6, 0), (0.6, 1), (0.6, 3), (0.9, 3)])
def test_bounces_of_a_closed_room_are_a_geometric_series(albedo, bounces):
    """Light is 1 + a + a^2 + ...; a share a^(n + 1) is cut off, and counts as an error."""
    scene = closed_room(albedo, bounces)
    light = sum(albedo**power for power in range(bounces + 1))
    assert seen(scene, 16) == pytest.approx(1 + albedo * light, rel=0.01)
    assert scene.light.error == pytest.approx(albedo ** (bounces + 1), rel=0.05, abs=0.02)


@pytest.mark.parametrize("albedo", [0.5, 0.9, 0.97])
def test_all_bounces_sum_the_series(albedo):
    scene = closed_room(albedo, "all")
    assert seen(scene, 16) == pytest.approx(1 / (1 - albedo), rel=0.01)
    assert scene.light.error < 0.02


def test_light_that_grows_with_each_bounce_is_an_infinite_error():
    assert closed_room(1.0, "all").light.error == np.inf
    dark = world(solid("icosphere", (0, 0, 0), radius=3.0), 1.0, bounces="all", cells=8)
    assert seen(dark, 16).max() == 0


@pytest.mark.parametrize(("distance", "error"), [(1.0, 0.3), (0.02, 0.06)])
def test_the_expected_error_is_that_of_the_picture(distance, error):
    """Of noise, and of the edge of what a near plate lights."""
    low, high = (0.1, -0.2), (0.5, 0.2)
    plate = rectangle(low, high, 1.5 - distance)
    scene = replace(
        world(np.concatenate([plain_scenes.wall(1.5, 1.0), plate])),
        materials=[Material("matt", (1.0,) * 3), Material("lamp", emission=(1.0,) * 3)],
        material_ids=np.int32([0, 0, 1, 1]), sky=np.zeros_like(WHITE),
        bake=BakeOptions(0, error=error, cells=16),
    )  # fmt: skip
    scene = lfcore.bake(scene)
    side = 256
    axis = scene.camera.field_width * ((np.arange(side) + 0.5) / side - 0.5) * 1.5
    places = np.stack(np.meshgrid(axis, axis), -1).reshape(-1, 2)
    off = seen(scene, side)[..., 0].ravel() - (wanted := factor_to(places, low, high, distance))
    on_wall = (abs(places - (0.3, 0.0)) > 0.2 / (1.5 - distance) * 1.5 + 0.02).any(1)
    off = off / np.maximum(wanted, 0.25 * wanted[on_wall].mean())
    real = np.sqrt((off[on_wall] ** 2).mean())
    assert 0.5 < scene.light.error / real < 2


def test_hard_shadows_of_wide_suns_are_errors():
    """A plate before a wall: the wider a sun, the wider are the half-shadows that are left out, in
    proportion.  The mean square error is, too."""
    towards = texel_directions(256)
    things = [plain_scenes.wall(1.5, 2.0), rectangle((-0.2, -0.2), (0.2, 0.2), 1.0)]

    def error(half_angle, towards=towards):
        disc = towards @ (0.3, 0.2, -np.sqrt(0.87)) > np.cos(half_angle)
        sky = np.where(disc[..., None], 0.1 / half_angle**2, 0.02)
        sky = np.repeat(sky, 3, axis=-1).astype(np.float32)
        made = world(np.concatenate(things), 0.0, bounces=0, error=0.1, cells=16)
        return lfcore.bake(under(made, sky)).light.error

    narrow, wide = error(0.015), error(0.06)
    assert wide > 0.03 and wide / narrow == pytest.approx(np.sqrt(0.06 / 0.015), rel=0.15)
    # A disc of two texels, with a half-shadow as narrow as our sun's.
    assert error(0.005, texel_directions(512)) == pytest.approx(0.02, rel=0.3)


def test_faces_that_the_sample_rays_miss_are_no_places_of_the_error():
    """Many slivers, each seen by few rays or none."""
    edges = np.linspace(-1, 1, 801)
    strips = [rectangle((a, -1), (b, 1), 1.5) for a, b in itertools.pairwise(edges)]
    things = np.concatenate([*strips, solid("box", (0, 0, 1.2), extents=(0.2, 0.2, 0.2))])
    light = lfcore.bake(world(things, bounces=1, error=0.1, cells=4)).light
    assert 0 < light.error < 0.5


def test_lamps_that_light_nothing_but_lamps():
    """A lamp behind another: none of their rays is useful, and their light was not a number."""
    near, far = rectangle((0.1, -1), (1, 1), 1.5), rectangle((-1, -1), (0.2, 1), 2.0)
    lamps = world(np.concatenate([near, far]), 0.5, 4.0, bounces=1, error=0.1, cells=8)
    values = lfcore.bake(lamps).light.values
    assert 0 <= values.min() and 1 < values.max() < 4 + 0.5 * 4


def test_what_goes_through_a_wall_brings_no_light_from_beyond():
    """A hidden triangle of one cell, with a corner outside of a dark room."""
    room = solid("icosphere", (0, 0, 0), subdivisions=2, radius=3.0)
    spike = np.array([[[-0.1, 0, -2.75], [0.1, 0, -2.75], [0, 0, -3.05]]])
    scene = lfcore.bake(world(np.concatenate([room, spike]), 1.0, bounces=1, error=0.1))
    assert scene.light.grids[-1, 2] == 1 and seen(scene, 16).max() == 0


def test_light_of_a_lamp_at_a_point_itself_is_finite():
    lamp = Light(POINT, (0.0, 0.0, 2.0), (1.0, 1.0, 1.0), 1.0, casts_shadows=False)
    scene = replace(world(plain_scenes.wall(3.0)), lights=[lamp])
    around = Surroundings(scene, build_bvh(scene.triangles), open_device())
    up = np.float32([[0, 0, -1]] * 2)
    found = around.of_lights(Points(np.float32([lamp.vector, (0, 0, 3)]), up, up, np.zeros(2)))
    assert found.tolist() == [[0, 0, 0], [1, 1, 1]]


def test_normals_that_cancel_between_corners_leave_the_triangle_its_own():
    normals = np.float32([[[1, 0, 0], [-1, 0, 0], [0, 1, 0]]])
    card = np.float32([[[-9, -9, 4], [9, -9, 4], [0, 9, 4]]])
    scene = lfcore.bake(replace(world(card), normals=normals))
    assert np.isfinite(scene.light.values).all()
    assert np.isfinite(seen(scene)).all()


def test_a_picture_of_the_sky_alone_is_the_sky():
    """All surfaces are behind the camera."""
    assert seen(world(plain_scenes.wall(-3.0), sky=0.3 * WHITE), 8) == pytest.approx(0.3)


@pytest.mark.parametrize("material", [{"transmission": 1.0}, {"diffuse": (0.0, 0.0, 0.0)}])
def test_light_passes_glass(material):
    """A plate that hides half of the sky from a wall, of glass or black."""
    plate = rectangle((-5, -5), (5, 5), 1.0).astype(np.float32)
    wall = plain_scenes.wall(1.5, 1.0)
    made = world(np.concatenate([wall, plate]), bounces=0, error=0.02)
    ids = np.repeat(np.int32([0, 1]), 2)
    materials = [*made.materials, Material("plate", **material)]
    # The camera sees the wall from between.
    camera = replace(made.camera, focus_m=1.2)
    scene = replace(made, materials=materials, material_ids=ids, camera=camera)
    moved = replace(scene, triangles=scene.triangles - np.float32([0, 0, 1.1]))
    light = on_grid(lfcore.bake(moved), 0, behind=True)[1]
    assert np.median(light) == pytest.approx(1 if "transmission" in material else 0, abs=0.03)


def test_a_sun_is_one_light_and_the_rest_is_a_sky():
    sky = np.ones((64, 64, 3), np.float32)
    sky[20, 40] = 1e5
    rest, (sun,) = suns(sky)
    assert rest.max() == 1
    flux = 1e5 * solid_angles(64)[20, 40] / np.pi
    assert sun.colour == pytest.approx((flux,) * 3, rel=1e-3)
    assert radiance(sky, np.float32([sun.vector]))[0] == pytest.approx(1e5, rel=1e-3)
    assert suns(np.ones((8, 8, 3), np.float32))[1] == []


@pytest.mark.parametrize("towards", [(0.6, 0, -0.8), (0, -0.8, -0.6), (0, 0, -1)])
def test_a_sun_across_the_fold_of_the_map_is_one_light(towards):
    sky = np.ones((64, 64, 3), np.float32)
    sky[texel_directions(64) @ towards > np.cos(0.05)] = 1e4
    rest, (sun,) = suns(sky)
    assert rest.max() == 1
    assert np.dot(sun.vector, towards) > np.cos(0.01)


@pytest.mark.parametrize("glare", [0.0, 300.0])
def test_a_plane_under_one_bright_texel(glare):
    """The texel's light by its solid angle and cosine, whatever its glare."""
    height, row, column = 128, 40, 200
    picture = np.full((height, 2 * height, 3), 0.5, np.float32)
    polar, turn = np.meshgrid(
        (np.arange(height) + 0.5) / height * np.pi, (np.arange(2 * height) + 0.5) / height * np.pi,
        indexing="ij",
    )  # fmt: skip
    angles = np.repeat(abs(np.diff(np.cos(np.arange(height + 1) / height * np.pi))), 2 * height)
    angles = angles.reshape(height, -1) * np.pi / height
    # World -z in the middle, y up; the camera looks along world z, its y down.
    d = np.stack([np.sin(turn - np.pi) * np.sin(polar), np.cos(polar),
                  -np.cos(turn - np.pi) * np.sin(polar)], -1)  # fmt: skip
    sun = d[row, column]
    picture += glare * np.exp(-np.arccos(np.clip(d @ sun, -1, 1)) / 0.1)[..., None]
    picture[row, column] += 2 / angles[row, column]
    to_world = np.diag([-1.0, -1.0, 1.0])
    sky = octahedral(picture, to_world, panorama_places, 256)
    # The wall faces the camera: its normal is world -z.
    wanted = 0.5 * (picture[..., 0] * angles * np.maximum(-d[..., 2], 0)).sum() / np.pi
    bare = world(plain_scenes.wall(1.5, 1.0), sky=WHITE, bounces=0, error=0.01)
    scene = under(replace(bare, sky=NO_SKY, clip=False), sky)
    assert len(scene.lights) == 1 and np.dot(scene.lights[0].vector, to_world.T @ sun) > 0.999
    assert seen(lfcore.bake(scene)).mean() == pytest.approx(wanted, rel=0.01)


def test_light_of_many_bright_spots_is_found():
    """Forty lamps, each in a few of ten thousand rays: eight are suns, the others are spread."""
    rng, side = np.random.default_rng(3), 256
    towards = texel_directions(side)
    lamps = rng.normal(size=(40, 3))
    lamps /= np.linalg.norm(lamps, axis=1, keepdims=True)
    nearest = (towards @ lamps.T).max(-1)
    sky = np.repeat(np.where(nearest > np.cos(0.01), 1000.0, 1.0)[..., None], 3, -1)
    sky = sky.astype(np.float32)
    rest, lights = suns(sky)
    assert len(lights) == 8 and rest.max() < 20

    def light(picture):
        facing = np.maximum(-towards[..., 2], 0)
        return (picture[..., 0].astype(float) * solid_angles(side) * facing).sum() / np.pi

    of_suns = sum(sun.colour[0] * max(-sun.vector[2], 0) for sun in lights)
    assert light(rest) + of_suns == pytest.approx(light(sky), rel=0.03)
    scene = lfcore.bake(world(plain_scenes.wall(1.5, 1.0), sky=sky, bounces=0, error=0.02))
    off = on_grid(scene, 0, behind=True)[1] / light(rest) - 1
    assert np.sqrt((off**2).mean()) < 0.02 and abs(off).max() < 0.1


def test_a_sun_in_wide_glare_is_taken_out():
    towards = texel_directions(256) @ np.array([0.6, 0.0, -0.8])
    glare = 200 * np.exp(-np.arccos(np.clip(towards, -1, 1)) / 0.1) + 1
    sky = np.repeat((glare + 5e4 * (towards > np.cos(0.02)))[..., None], 3, -1)
    rest, (sun,) = suns(sky.astype(np.float32))
    assert np.dot(sun.vector, (0.6, 0, -0.8)) > np.cos(0.005)
    assert rest.max() < 200 and 0.02 < sun.angular_radius < 0.08
    light = (sky.mean(-1) * solid_angles(256)).sum()
    kept = (rest.mean(-1).astype(float) * solid_angles(256)).sum()
    assert kept + np.pi * sun.colour[0] == pytest.approx(light, rel=1e-3)


def test_a_panorama_is_where_the_page_says():
    """World -z in its middle, +x to the right, y up; turned to the right."""
    picture = np.zeros((64, 128, 3), np.float32)
    picture[:, 92:100, 0] = 1  # a quarter of a turn to the right
    picture[:8, :, 1] = 1
    to_camera = np.diag([1.0, -1.0, -1.0])  # x right, y down, z forward
    looks = np.float32([[1, 0, 0], [0, -1, 0], [0, 0, 1], [-1, 0, 0], [0, 0, -1]])
    for turned, red in ((0.0, 0), (np.pi / 2, 4), (-np.pi / 2, 2), (np.pi, 3)):
        places = partial(panorama_places, turned=turned)
        found = radiance(octahedral(picture, to_camera, places, 64), looks)
        assert np.flatnonzero(found[:, 0] > 0.9).tolist() == [red]
        assert found[1, 1] == pytest.approx(1, abs=0.01)


def test_the_same_light_from_any_number_of_threads(tmp_path):
    things = [solid("box", (0.2, 0.1, 2), extents=(0.5, 0.5, 0.5)), plain_scenes.wall(2.6)]
    scene = world(np.concatenate(things), bounces=2, cells=8)
    one, two = (
        lfcore.bake(scene, device=lfcore.open_device(threads=threads)).light for threads in (1, 2)
    )
    assert (one.values == two.values).all() and (one.grids == two.grids).all()
    one.save(tmp_path / "light.npz")
    again = BakedLight.load(tmp_path / "light.npz")
    assert (again.values == one.values).all() and again.error == one.error


def test_what_cannot_be_baked_or_traced_is_refused():
    scene = world(plain_scenes.wall(2.0))
    with pytest.raises(lfcore.SceneError, match="not baked"):
        Tracer(scene, None)
    with pytest.raises(lfcore.SceneError, match=r"material matt: diffuse.*1\.5.*Give at most 1"):
        lfcore.bake(world(plain_scenes.wall(2.0), 1.5))


def test_a_mesh_under_a_sky_of_ones_own(tmp_path):
    import cv2

    trimesh.creation.icosphere().export(tmp_path / "ball.ply")
    cv2.imwrite(str(tmp_path / "sky.hdr"), np.full((16, 32, 3), (1.0, 0.5, 0.25), np.float32))
    light = {"sky": {"file": "sky.hdr", "strength": 2}, "bounces": 0, "bake_cells": 48}
    scene = lfcore.load_scene(tmp_path / "ball.ply", light=light)
    assert isinstance(scene, Scene) and scene.lights == []
    assert seen(scene, 16)[0, 0] == pytest.approx([0.5, 1, 2], rel=0.02)
    assert lfcore.bake(scene, bounces=1, error=0.1).bake == BakeOptions(1, 0.1, cells=48)


def in_a_veil(**veil):
    """A matt wall at 2 m, within a box of a black veil, in a white sky."""
    box = trimesh.creation.box((6, 6, 6)).triangles
    room = world(np.concatenate([plain_scenes.wall(2, 0.5), box]).astype(np.float32), bounces=0)
    black = Material("veil", (0.0,) * 3, **veil)
    return replace(
        room, materials=[*room.materials, black], material_ids=np.repeat(np.int32([0, 1]), [2, 12])
    )


@pytest.mark.parametrize("opacity", [0.25, 0.7])
def test_light_passes_veils_by_what_their_opacity_leaves(opacity):
    """The wall sees nothing but the sky, all of it through the veil."""
    picture = seen(in_a_veil(opacity=opacity))
    assert picture[16:32, 16:32].mean() == pytest.approx(0.5 * (1 - opacity), rel=0.02)


def test_light_passes_veils_by_the_alpha_of_their_texture():
    """Of 100 texels, 60 are clear and 40 half opaque; the corners have any coordinates."""
    texels = np.zeros((10, 10, 4), np.uint8)
    texels[:4, :, 3] = 128
    plain = in_a_veil()
    black = replace(plain.materials[1], texture=0, alpha_blend=True)
    uvs = np.float32([[0, 0], [1, 0], [1, 1]])[None].repeat(14, 0) * 7
    kinds = [plain.materials[0], black]
    picture = seen(replace(plain, textures=[texels], uvs=uvs, materials=kinds))
    assert picture[16:32, 16:32].mean() == pytest.approx(0.5 * (1 - 0.4 * 128 / 255), rel=0.03)


def test_lamps_shine_through_each_veil():
    lamp = Light(POINT, (0.0, 0.0, -1.0), (1.0, 1.0, 1.0))
    triangles = np.concatenate([plain_scenes.wall(z) for z in (2, 1, 0.5)]).astype(np.float32)
    room = world(triangles)
    veils = [Material("a", opacity=0.5), Material("b", opacity=0.2)]
    for opaque in (False, True):
        kinds = [*room.materials, *([Material("c")] * 2 if opaque else veils)]
        ids = np.repeat(np.arange(3, dtype=np.int32), 2)
        hung = replace(room, lights=[lamp], materials=kinds, material_ids=ids)
        around = Surroundings(hung, build_bvh(triangles), open_device())
        up = np.float32([[0, 0, -1]])
        points = Points(np.float32([[0.2, 0.1, 2.0]]), up, up, np.full(1, 0.01))
        found = around.of_lights(points)[0, 0]
        cosine = 3 / np.sqrt(9 + 0.05)
        assert found == pytest.approx(0 if opaque else 0.5 * 0.8 * cosine, rel=1e-5)


def test_what_mirrors_and_veils_show_is_baked_as_what_is_seen():
    """A wall behind the camera, in a mirror, and one behind a veil: their grids are as fine as that
    of a wall that is seen."""
    mirror, veil, behind, beyond = (
        plain_scenes.wall(z, half) for z, half in ((2.0, 0.5), (1.5, 4.0), (-1.0, 6.0), (4.0, 9.0))
    )
    triangles = np.concatenate([mirror, veil, behind, beyond]).astype(np.float32)
    room = world(triangles, bounces=0)
    kinds = [Material("mirror", (1.0,) * 3, metallic=1.0, roughness=0.0),
             Material("veil", opacity=0.5), *room.materials]  # fmt: skip
    sides = []
    for veiled in (kinds, [replace(kinds[2]), *kinds[1:]]):
        made = replace(room, materials=veiled, material_ids=np.repeat(np.int32([0, 1, 2, 2]), 2))
        sides.append(lfcore.bake(made).light.grids[:, 2])
    assert (sides[0][4:6] > sides[1][4:6]).all()  # behind the camera, by the mirror
    assert (sides[1][6:] >= 8).all()
