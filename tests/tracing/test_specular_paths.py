"""Paths over mirrors, glass, coats and veils: light and depth are the oracle's."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from specular_reference import ray_numbers, trace_paths
from tracing_scenes import CAMERA, LAMP, SUN, WALL, bent_normals, scene, tiles, tracer_of

from lfcore import Slab, open_device
from lfcore.optics import bundles
from lfcore.oracle.shading import radiance
from lfcore.scene.appearance import Material
from lfcore.tracing.specular import follow

pytestmark = pytest.mark.kernels
GLASS = {"metallic": 0.0, "roughness": 0.0, "transmission": 1.0, "diffuse": (1.0, 1.0, 1.0)}
KINDS = {
    "mirror": {"metallic": 1.0, "roughness": 0.0, "diffuse": (0.9, 0.8, 0.7)},
    "glass": {**GLASS, "ior": 1.5},
    "absorbing": {**GLASS, "ior": 1.3, "attenuation_distance_m": 0.5,
                  "attenuation_colour": (0.9, 0.5, 0.2)},
    "pane": {**GLASS, "transmission": 0.9, "thin_walled": True},
    "coat": {"diffuse": (0.5, 0.6, 0.2), "clearcoat": 1.0},
    "coated metal": {"metallic": 0.6, "roughness": 0.5, "clearcoat": 0.8},
    "veil": {"diffuse": (0.5, 0.6, 0.2), "opacity": 0.3, "specular": (0.3, 0.3, 0.3)},
    "nothing": {**GLASS, "opacity": 0.0},
    "index 1": {**GLASS, "ior": 1.0},
    "rough metal": {"metallic": 1.0, "roughness": 0.3, "diffuse": (0.9, 0.8, 0.7)},
    "rough dielectric": {"metallic": 0.0, "roughness": 0.1, "diffuse": (0.9, 0.8, 0.7)},
    "rough coat": {"diffuse": (0.5, 0.6, 0.2), "clearcoat": 1.0, "clearcoat_roughness": 0.2},
    "rough coat on rough metal": {"metallic": 0.9, "roughness": 0.2, "clearcoat": 1.0,
                                  "clearcoat_roughness": 0.1, "opacity": 0.7},
}  # fmt: skip


PITCHES = 0.01, 0.003, 4


def world(**material):
    """A ball, smooth by its normals, between a mosaic of colours and a wall."""
    ball = trimesh.creation.icosphere(2, radius=0.5)
    things = ball.triangles + [0.1, 0, 2.0], tiles(3.5, 1.5, 3), WALL
    triangles = np.concatenate(things).astype(np.float32)
    count, rng = len(ball.triangles), np.random.default_rng(1)
    normals = bent_normals(triangles, rng, 0.0)
    normals[:count] = ball.vertices[ball.faces] / 0.5
    return scene(
        triangles,
        normals=normals,
        colours=(0.5 + rng.random(triangles.shape) / 2).astype(np.float32),
        materials=[Material("ball", **material), Material("matt")],
        material_ids=np.repeat(np.int32([0, 1]), [count, len(triangles) - count]),
        lights=[LAMP],
    )


def camera_rays(count=300, seed=1, spread=0.3):
    """Rays from a lens 2 cm wide."""
    rng = np.random.default_rng(seed)
    origins, directions = np.zeros((count, 3), np.float32), np.ones((count, 3), np.float32)
    origins[:, :2] = rng.normal(size=(count, 2)) * 0.02
    directions[:, :2] = rng.uniform(-spread, spread, (count, 2))
    return origins, directions


def compare(scene, rays, most=2e-5, **options):
    """Both parts are the oracle's, but where rays graze edges."""
    tracer = tracer_of(scene, specular=True)
    found = follow(tracer._on_device, *rays, 0.0, pitches=PITCHES, **options)
    numbers = ray_numbers(*rays, *PITCHES[:2], bits=2)
    expected = trace_paths(scene, *rays, 0.3, numbers=numbers, **options)
    parts = (
        (found.own, expected.own, found.own_depth, expected.own_inverse_depth),
        (found.specular, expected.specular, found.specular_depth, expected.inverse_depth),
    )
    for light, true_light, depth, true_depth in parts:
        off = np.abs(np.clip(light, 0, 1) - np.clip(true_light, 0, 1)).max(1)
        assert (off > most).mean() < 0.02 and np.median(off) < most / 20
        seen = true_light.max(1) > 0
        off = np.abs(1 / depth[seen] - true_depth[seen])
        assert not len(off) or ((off > 1e-4).mean() < 0.03 and np.median(off) < 2e-6)
    assert np.abs(found.cut - expected.cut).mean() < 1e-4
    return found, expected


@pytest.mark.parametrize("name", KINDS)
def test_paths_over_a_ball_are_the_oracles(name):
    _, expected = compare(world(**KINDS[name]), camera_rays())
    seen = (expected.specular.max(1) > 0.01).mean()
    assert seen == 0 if name == "nothing" else seen > 0.05


def test_textures_that_bend_and_veil_are_the_oracles():
    """A pane of glass whose alpha, roughness and normals come from textures, over a mosaic."""
    rng = np.random.default_rng(4)
    pane = np.float32(
        [[[-1, -1, 2], [1, -1, 2.2], [1, 1, 2.2]], [[-1, -1, 2], [1, 1, 2.2], [-1, 1, 2]]]
    )
    triangles = np.concatenate([pane, tiles(3.0, 1.5, 4)]).astype(np.float32)
    smooth = 128 + rng.integers(-20, 20, (6, 6, 3))
    smooth[..., 2] = 240
    textures = [rng.integers(60, 255, (5, 4, 4), np.uint8), smooth.astype(np.uint8)]
    textures += [np.full((2, 2, 3), 255, np.uint8), rng.integers(60, 255, (5, 4, 3), np.uint8)]
    front = Material("pane", (0.9, 0.8, 0.7), metallic=0.8, roughness=0.05, texture=0,
                     normal_texture=1, metal_texture=2, alpha_blend=True, opacity=0.9)  # fmt: skip
    veiled = scene(
        triangles,
        uvs=(triangles[..., :2] * 2).astype(np.float32),
        textures=textures,
        materials=[front, Material("matt", texture=3)],
        material_ids=np.repeat(np.int32([0, 1]), [2, len(triangles) - 2]),
        lights=[LAMP, SUN],
    )
    compare(veiled, camera_rays(), most=2e-3)


@pytest.mark.parametrize("most_events", [0, 1, 3, 8])
def test_mirrors_that_face_each_other_end_and_say_what_they_cut(most_events):
    sheet = np.float32([[[-1, -1, 0], [1, -1, 0], [1, 1, 0]], [[-1, -1, 0], [1, 1, 0], [-1, 1, 0]]])
    low, high = (sheet[..., [0, 2, 1]] + [0, y, 1.2] for y in (-0.1, 0.1))
    triangles = np.concatenate([low, high, WALL]).astype(np.float32)
    mirror = Material("mirror", (0.9, 0.9, 0.9), metallic=1.0, roughness=0.0)
    ids = np.int32([0] * 4 + [1] * 2)
    facing = scene(triangles, materials=[mirror, Material("matt")], material_ids=ids)
    found, _ = compare(facing, camera_rays(spread=0.45), most_events=most_events)
    assert (found.cut > 0).any() == (most_events < 8)


def test_a_plane_mirror_shows_the_unfolded_depth():
    """What is behind the lens's back, by the way to the mirror and back."""
    mirror = np.float32(
        [[[-3, -3, 2], [3, -3, 2], [3, 3, 2]], [[-3, -3, 2], [3, 3, 2], [-3, 3, 2]]]
    )
    back = mirror - np.float32([0, 0, 3])
    materials = [Material("mirror", (1.0, 1.0, 1.0), metallic=1.0, roughness=0.0), Material("matt")]
    room = scene(np.concatenate([mirror, back]), materials=materials,
                 material_ids=np.int32([0, 0, 1, 1]))  # fmt: skip
    found = follow(tracer_of(room, specular=True)._on_device, *camera_rays(), 0.0)
    np.testing.assert_allclose(found.own_depth, 2, rtol=1e-5)
    np.testing.assert_allclose(found.specular_depth, 5, rtol=1e-5)


def test_faces_that_coincide_are_both_met():
    """A cube of glass whose back touches the front of another."""
    box = trimesh.creation.box((0.8, 0.8, 0.4))
    boxes = [box.triangles + [0, 0, z] for z in (2.0, 2.4)]
    triangles = np.concatenate([*boxes, tiles(3.0, 1.5, 3)]).astype(np.float32)
    materials = [Material("a", **{**GLASS, "ior": 1.5}), Material("b", **{**GLASS, "ior": 1.2}),
                 Material("matt")]  # fmt: skip
    ids = np.repeat(np.int32([0, 1, 2]), [12, 12, len(triangles) - 24])
    compare(scene(triangles, materials=materials, material_ids=ids), camera_rays(spread=0.12))


def test_a_camera_sees_one_part_or_two():
    matt, glass = world(), world(**KINDS["glass"])
    rays = bundles.views(Slab(CAMERA, 3, 24), np.int32([[0, 0], [2, 1]]))
    tracer = tracer_of(matt, specular=True)
    (one,) = tracer.parts(rays)
    for found, expected in zip(one, tracer.radiance_and_depth(rays), strict=True):
        np.testing.assert_array_equal(found, expected)
    own, shown = tracer_of(glass, specular=True).parts(rays)
    paths = trace_paths(glass, *(part.reshape(-1, 3) for part in rays.rays()), CAMERA.delta)
    for (light, depth), true, inverse in (
        (own, paths.own, paths.own_inverse_depth), (shown, paths.specular, paths.inverse_depth),
    ):  # fmt: skip
        off = np.abs(np.clip(light.reshape(-1, 3), 0, 1) - true).max(1)
        assert (off > 1e-4).mean() < 0.02 and np.median(off) < 1e-6
        seen = true.max(1) > 0
        assert (seen & (depth.ravel() == 0)).mean() < 0.01
        off = np.abs(1 / depth.ravel()[seen] - inverse[seen])
        assert (off > 1e-4).mean() < 0.02
    whole = tracer_of(glass, specular=True).bundle_radiance(rays)
    np.testing.assert_array_equal(whole, own[0] + shown[0])
    mosaic = tracer_of(glass, specular=True).mosaic_radiance([rays, rays], 1)
    np.testing.assert_array_equal(mosaic, 2 * whole.reshape(mosaic.shape))
    away = replace(rays, elements=rays.elements + np.float32([0, 0, 1, 0]))
    assert len(tracer_of(glass, specular=True).parts(away)) == 1


@pytest.mark.parametrize("angular_radius", [0.0, 0.01])
def test_a_mirror_has_no_highlight_of_a_sun_that_its_rays_meet(angular_radius):
    sun = replace(SUN, angular_radius=angular_radius)
    _, expected = compare(replace(world(**KINDS["mirror"]), lights=[sun]), camera_rays(2000))
    shining = expected.own[expected.specular.max(1) > 0]
    assert (shining.max() > 0.1) == (angular_radius == 0)


@pytest.mark.parametrize("name", ["rough metal", "rough coat"])
def test_a_sun_is_a_highlight_of_rough_surfaces_and_their_rays_meet_the_sky(name):
    even = np.full((16, 16, 3), 0.5, np.float32)
    rough = replace(world(**KINDS[name]), lights=[SUN])
    _, expected = compare(replace(rough, sky=even), camera_rays(2000))
    _, dark = compare(replace(rough, background=(0.0, 0.0, 0.0)), camera_rays(2000))
    seen = expected.specular.max(1) > 0
    assert expected.own[seen].max() > 0.5
    assert (expected.specular - dark.specular).max() > 0.01


@pytest.mark.parametrize("metallic", [0.0, 1.0])
@pytest.mark.parametrize("roughness", [0.031, 0.3])
def test_rough_floors_are_the_oracles_to_the_horizon(roughness, metallic):
    """Rays meet the floor at 20 to 0.006 degrees."""
    square = np.float32(
        [[[-1, -1, 0], [1, -1, 0], [1, 1, 0]], [[-1, -1, 0], [1, 1, 0], [-1, 1, 0]]]
    )
    floor = square[..., [0, 2, 1]] * 1000 + np.float32([0, 0.2, 1000.5])
    wall = square * 1000 + np.float32([0, 0, 2000])
    materials = [Material("floor", metallic=metallic, roughness=roughness), Material("matt")]
    plain = scene(
        np.concatenate([floor, wall]), materials=materials, material_ids=np.int32([0, 0, 1, 1])
    )
    origins, directions = np.zeros((200, 3), np.float32), np.ones((200, 3), np.float32)
    directions[:, 0], directions[:, 1] = 0, 0.2 / np.geomspace(0.55, 1900, 200)
    found, expected = compare(plain, (origins, directions))
    assert (expected.specular.max(1) > 0).mean() > 0.5 and np.isfinite(found.specular).all()


@pytest.mark.parametrize("single_rays", [False, True])
@pytest.mark.parametrize("name", ["absorbing", "pane", "veil", "mirror"])
def test_shadows_of_what_light_passes_are_tinted(name, single_rays):
    """Behind the ball, in the sun: blocks of rays, or single ones."""
    lit = replace(world(**KINDS[name]), lights=[SUN], ambient=(0.0, 0.0, 0.0))
    rays = bundles.views(Slab(CAMERA, 2, 32), np.int32([[0, 0]]))
    tracer = tracer_of(lit, specular=True, single_rays=single_rays)
    found = tracer.bundle_radiance(rays).reshape(-1, 3)
    paths = trace_paths(lit, *(part.reshape(-1, 3) for part in rays.rays()), CAMERA.delta)
    off = np.abs(np.clip(found, 0, 1) - np.clip(paths.own + paths.specular, 0, 1)).max(1)
    assert (off > 1e-3).mean() < 0.02 and np.median(off) < 1e-5
    behind = paths.specular.max(1) == 0
    bright = paths.own[behind].max(1)
    tinted = (bright > 0.02) & (bright < 0.6 * np.quantile(bright, 0.9))
    assert tinted.any() == (name != "mirror")


def shadow_light(scene, places):
    """The light of the wall at places (R, 2), by the tracer and by the oracle."""
    origins = np.float32([(x, y, 4.0) for x, y in places])
    towards = np.float32([[0, 0, 1]] * len(places))
    tracer = tracer_of(scene, specular=True)
    found = tracer.hit_radiance(origins, towards, tracer.closest_hit(origins, towards))
    return found, radiance(scene, origins, towards)


@pytest.mark.parametrize("name", ["veil", "absorbing"])
def test_shadows_of_edges_and_corners_are_tinted_once(name):
    """In the sun, through the diagonals, edges and corners of a box and of its silhouette."""
    box = trimesh.creation.box((1.0, 1.0, 0.5)).triangles + [0, 0, 2.0]
    materials = [Material("box", **KINDS[name]), Material("matt", (1.0, 1.0, 1.0))]
    ids = np.repeat(np.int32([0, 1]), [len(box), len(WALL)])
    sun = replace(SUN, vector=(0.0, 0.0, -1.0), colour=(1.0, 1.0, 1.0))
    lit = scene(np.concatenate([box, WALL]).astype(np.float32), materials=materials,
                material_ids=ids, lights=[sun], ambient=(0.0, 0.0, 0.0))  # fmt: skip
    within = [(0.25, 0.25), (0.25, -0.25), (0.0, 0.0), (0.3, 0.1)]
    found, expected = shadow_light(lit, within)
    np.testing.assert_allclose(found, expected, atol=1e-6)
    np.testing.assert_allclose(found, np.tile(found[-1], (4, 1)), atol=1e-6)
    around = shadow_light(lit, [(0.5, y) for y in (0.5, 0.25, 0.0, -0.5)])
    for light in np.concatenate(around):  # inside, or beside
        assert np.allclose(light, found[-1]) or np.allclose(light, 1.0)


def test_shadows_have_the_colours_of_stained_glass():
    """A pane with colours of a texture and of its corners; a texture says that it is no metal."""
    rng = np.random.default_rng(5)
    pane = np.float32([[[-1, -1, 2], [1, -1, 2], [1, 1, 2]], [[-1, -1, 2], [1, 1, 2], [-1, 1, 2]]])
    triangles = np.concatenate([pane, WALL])
    colours = np.ones(triangles.shape, np.float32)
    colours[:2] = rng.random((2, 3, 3))
    stained = Material("pane", (0.9, 0.8, 1.0), metallic=1.0, transmission=0.8, thin_walled=True,
                       texture=0, metal_texture=1)  # fmt: skip
    lit = scene(
        triangles,
        uvs=(triangles[..., :2] / 3).astype(np.float32),
        colours=colours,
        textures=[rng.integers(60, 255, (5, 4, 3), np.uint8),
                  rng.integers(0, 128, (2, 2, 3), np.uint8)],
        materials=[stained, Material("matt", (1.0, 1.0, 1.0))],
        material_ids=np.int32([0, 0, 1, 1]),
        lights=[SUN],
        ambient=(0.0, 0.0, 0.0),
    )  # fmt: skip
    found, expected = shadow_light(lit, rng.uniform(-0.8, 0.8, (50, 2)))
    np.testing.assert_allclose(found, expected, atol=1e-3)  # texels have ten bits
    assert (expected.max(0) - expected.min(0)).min() > 0.1


@pytest.mark.parametrize("kind", ["absorbing", "rough coat on rough metal"])
def test_paths_have_the_same_bits_in_all_lanes(device, kind):
    rays, bits = camera_rays(700), []
    for lanes in (1, 4, 8, 16):
        tracer = tracer_of(
            world(**KINDS[kind]), open_device(device.name, lanes=lanes), specular=True
        )
        bits.append(
            np.concatenate([part.ravel() for part in follow(tracer._on_device, *rays, 0.01)])
        )
    for other in bits[1:]:
        np.testing.assert_array_equal(bits[0], other)


def seen_along_the_axis(parts, normals=None):
    """What one ray near the axis sees of (triangles, fields of a material), the last glowing."""
    triangles = np.concatenate([np.float32(triangles) for triangles, _ in parts])
    ids = np.repeat(np.arange(len(parts), dtype=np.int32), [len(each) for each, _ in parts])
    glow = {"diffuse": (0.0,) * 3, "emission": (0.5, 0.5, 0.5)}
    kinds = [Material(str(k), **each) for k, (_, each) in enumerate([*parts[:-1], (0, glow)])]
    dark = {"ambient": (0.0,) * 3, "background": (0.0,) * 3, "clip": False}
    made = scene(triangles, materials=kinds, material_ids=ids, **dark)
    if normals is not None:
        rest = np.broadcast_to(np.float32([0, 0, -1]), (len(triangles) - len(normals), 3, 3))
        made = replace(made, normals=np.concatenate([normals, rest]).astype(np.float32))
    origins, directions = np.zeros((1, 3), np.float32), np.float32([[2e-3, 1e-3, 1.0]])
    return follow(tracer_of(made, specular=True)._on_device, origins, directions, 0.0)


def test_balls_of_glass_and_chrome_focus_where_they_must():
    """Far things: 1.5 radii before the middle of a ball with n = 1.5, in chrome half a radius
    behind its front."""
    sphere = trimesh.creation.icosphere(6)
    near = np.hypot(*sphere.vertices[:, :2].T)[sphere.faces].min(1) < 0.06
    normals = sphere.vertices[sphere.faces[near]]
    for name, far, expected in (("glass", 1004.0, 2.5), ("mirror", -997.0, 3.5)):
        back = np.float32(
            [[[-1, -1, 0], [1, -1, 0], [1, 1, 0]], [[-1, -1, 0], [1, 1, 0], [-1, 1, 0]]]
        )
        parts = [(normals + [0, 0, 4], KINDS[name]), (back * 3000 + np.float32([0, 0, far]), {})]
        seen = seen_along_the_axis(parts, normals)
        np.testing.assert_allclose(seen.specular_depth, expected, rtol=0.01)


def test_a_prism_reflects_wholly():
    """Light turns by 90 degrees within it, without loss, and what is below appears unfolded."""
    corners = [(x, y, z) for x in (-1, 1) for y, z in ((-1, 2), (1, 2), (-1, 4))]
    floor = (
        [[-20, -3, -20], [20, -3, -20], [20, -3, 20]],
        [[-20, -3, -20], [20, -3, 20], [-20, -3, 20]],
    )
    prism = trimesh.Trimesh(corners).convex_hull.triangles
    seen = seen_along_the_axis([(prism, KINDS["glass"]), (np.float32(floor), {})])
    np.testing.assert_allclose(seen.specular, 0.96 * 0.5, rtol=1e-4)
    np.testing.assert_allclose(seen.specular_depth, 2 + 2 / 1.5 + 2, rtol=0.01)
