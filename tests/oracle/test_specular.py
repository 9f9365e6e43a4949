"""Mirrors, glass, coats and veils of the reference against closed forms."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from plain_scenes import scene, wall
from specular_reference import (
    NEAREST,
    fresnel,
    ray_numbers,
    trace_paths,
    unhidden,
    visible_facets,
)

from lfcore import Material
from lfcore.scene.sky_gloss import SHARES, reflected_shares
from lfcore.scene.transforms import rotate

DELTA = 0.3
WHITE = (1.0, 1.0, 1.0)
MIRROR = Material("mirror", WHITE, metallic=1.0, roughness=0.0)
GLASS = Material("glass", WHITE, transmission=1.0)
GLOW = Material("glow", (0, 0, 0), emission=(0.5, 0.25, 0.125))
RAYS = [(0, 0, 1e-4, 2e-4), (0.02, 0.01, 0.1, -0.2), (-0.01, 0.02, -0.3, 0.15)]
"""Lens points and pixels, (s, t, x, y)."""


def paths(world, rays=RAYS, **more):
    s, t, x, y = np.array(rays, float).T
    origins = np.stack([s, t, 0 * s], 1)
    directions = np.stack([x - DELTA * s, y - DELTA * t, 1 + 0 * s], 1)
    return trace_paths(world, origins, directions, DELTA, **more)


def made(*parts, **changes):
    """A scene of (triangles, material) in which nothing but emission gives light."""
    triangles = np.concatenate([np.float32(triangles) for triangles, _ in parts])
    numbers = np.repeat(np.arange(len(parts)), [len(t) for t, _ in parts]).astype(np.int32)
    dark = {"ambient": (0, 0, 0), "background": (0, 0, 0), "clip": False}
    given = {"materials": [material for _, material in parts], "material_ids": numbers}
    return scene(triangles, **{**dark, **given, **changes})


def box(z, thickness, half=4.0, **more):
    """A slab across the axis, fronts outward."""
    low, high = (-half, -half, z), (half, half, z + thickness)
    return trimesh.creation.box(bounds=[low, high]).triangles


def ball(centre_z, radius=1.0):
    """Triangles and normals of a sphere near the axis."""
    sphere = trimesh.creation.icosphere(6)
    near = np.hypot(*sphere.vertices[:, :2].T)[sphere.faces].min(1) < 0.06
    unit = sphere.vertices[sphere.faces[near]]
    return radius * unit + (0, 0, centre_z), np.float32(unit)


@pytest.mark.parametrize("turn", [0, 20, 40])
def test_a_plane_mirror_shows_the_mirrored_scene(turn):
    turned = rotate("y", turn)[:3, :3]
    mirror = (wall(0.0) @ turned.T + (0, 0, 2)).astype(np.float32)
    normal = turned[:, 2]
    object_ = wall(-3.0, 50.0).astype(np.float64) @ rotate("y", 2 * turn)[:3, :3].T
    through = paths(made((mirror, MIRROR), (object_, GLOW)))
    unfolded = object_ - 2 * ((object_ - (0, 0, 2)) @ normal)[..., None] * normal
    direct = paths(made((unfolded, GLOW)))
    np.testing.assert_allclose(through.inverse_depth, direct.own_inverse_depth, rtol=1e-5)
    np.testing.assert_allclose(through.specular, direct.own)
    assert not through.own.any() and not through.cut.any()


def test_facing_mirrors_unfold_and_what_is_cut_is_told():
    dull = replace(MIRROR, diffuse=(0.9,) * 3)
    # Two mirrors at 45 degrees, as in a periscope, before a wall.
    first = wall(0.0, 1.5) @ rotate("x", 45)[:3, :3].T + (0, 0, 2)
    second = wall(0.0, 1.5) @ rotate("x", 45)[:3, :3].T
    up = np.array(rotate("x", 45)[:3, :3] @ (0, 0, 1))
    towards = np.array([0, 0, 1.0]) - 2 * up[2] * up
    seen = paths(
        made((first, dull), (second + (0, 0, 2) + 3 * towards, dull), (wall(9.0, 20), GLOW))
    )
    np.testing.assert_allclose(seen.inverse_depth[0], 1 / (2 + 3 + 7), rtol=1e-5)
    np.testing.assert_allclose(seen.specular[0], 0.81 * np.array(GLOW.emission), rtol=1e-3)
    for most in (3, 8):
        endless = paths(made((wall(2.0), dull), (wall(-1.0), dull)), RAYS[:1], most_events=most)
        assert endless.cut[0] == pytest.approx(0.9 ** (most + 1))
        assert endless.inverse_depth[0] == pytest.approx(1 / (2 + 3 * most), rel=1e-5)


@pytest.mark.parametrize("indices", [(1.5,), (1.5, 1.33), (1.0,)])
def test_a_slab_brings_things_nearer(indices):
    parts = [(box(2 + k, 1), replace(GLASS, ior=n, name=str(n))) for k, n in enumerate(indices)]
    seen = paths(made(*parts, (wall(6.0), GLOW)))
    nearer = sum(1 - 1 / n for n in indices)
    assert seen.inverse_depth[0] == pytest.approx(1 / (6 - nearer), rel=1e-5)
    ends = [1.0, *indices, 1.0]
    # What is not reflected; the reflected rays that split off find nothing but darkness.
    passed = np.prod([1 - ((a - b) / (a + b)) ** 2 for a, b in itertools.pairwise(ends)])
    assert seen.specular[0] == pytest.approx(passed * np.array(GLOW.emission), rel=2e-2)
    if indices == (1.0,):
        np.testing.assert_allclose(seen.specular, np.tile(GLOW.emission, (3, 1)))
        np.testing.assert_allclose(seen.inverse_depth, 1 / 6, rtol=1e-6)


def test_a_ball_of_glass_has_its_focus_and_a_chrome_ball_has_its_own():
    triangles, normals = ball(4.0)
    rays = [(0, 0, 0.002, 0.001), (0.003, 0.0, 0.0005, 0.001)]

    def seen(material, far):
        world = made((triangles, material), (far, GLOW))
        flat = np.tile(np.float32([0, 0, 1]), (2, 3, 1))
        return paths(replace(world, normals=np.concatenate([normals, flat])), rays)

    focal = 1.5 / (2 * 0.5)
    image = 1 / (1 / focal - 1 / 30)
    glass = seen(GLASS, wall(34.0, 100))
    np.testing.assert_allclose(glass.inverse_depth, 1 / (4 - image), rtol=0.01)
    chrome = seen(MIRROR, wall(-97.0, 1000))
    behind = 1 / (2 + 1 / 100)
    np.testing.assert_allclose(chrome.inverse_depth, 1 / (3 + behind), rtol=0.01)


def test_grazing_rays_leave_a_ball_of_glass():
    """They are reflected within it up to the last event, if they follow the stronger ray."""
    unit = trimesh.creation.icosphere(3).triangles
    unit = np.float32(unit / np.linalg.norm(unit, axis=-1, keepdims=True))
    world = made((unit + np.float32([0, 0, 4]), GLASS), background=WHITE, ambient=(100.0,) * 3)
    limb = math.tan(math.asin(1 / 4))
    turn = np.linspace(0, 6, 40)
    rays = np.stack([0 * turn, 0 * turn, np.cos(turn), np.sin(turn)], 1) * 0.995 * limb
    seen = paths(replace(world, normals=unit), rays)
    hit = seen.own_inverse_depth > 0
    assert hit.mean() > 0.5 and np.median(seen.cut[hit]) < 0.2
    assert np.median(seen.specular[hit]) == pytest.approx(1, abs=1e-6)


def test_fresnel_at_brewster_s_angle_and_at_total_reflection():
    for n in (1.33, 1.5, 2.4):
        brewster = math.atan(n)
        # Only light across the plane of incidence is reflected.
        expected = ((n**2 - 1) / (n**2 + 1)) ** 2 / 2
        assert fresnel(np.cos([brewster]), np.array([1 / n])) == pytest.approx(expected)
        critical = math.asin(1 / n)
        shares = fresnel(np.cos([critical - 0.05, critical + 1e-6]), np.array([n, n]))
        assert shares[0] < 0.5 and shares[1] == 1
    straight = fresnel(np.array([1.0, 1.0]), np.array([1 / 1.5, 1.5]))
    np.testing.assert_allclose(straight, 0.04)
    assert fresnel(np.array([0.0]), np.array([1 / 1.5])) == pytest.approx(1)
    assert not fresnel(np.array([0.0, 0.3]), np.ones(2)).any()


def test_a_prism_reflects_wholly_and_is_a_slab():
    corners = [(x, y, z) for x in (-1, 1) for y, z in ((-1, 2), (1, 2), (-1, 4))]
    prism = trimesh.Trimesh(corners).convex_hull
    floor = np.float32(wall(0.0, 20.0)[..., [0, 2, 1]]) - np.float32([0, 3, 0])
    seen = paths(made((prism.triangles, GLASS), (floor, GLOW)), RAYS[:1])
    # The third event sends all on along the stronger ray.
    assert seen.specular[0] == pytest.approx(0.96 * np.array(GLOW.emission), rel=1e-6)
    assert seen.cut[0] == pytest.approx(0.96 * 0.04)
    # From the prism's middle, at depth 3, down to y = -1 in glass and to -3 in air.
    assert seen.inverse_depth[0] == pytest.approx(1 / (2 + 2 / 1.5 + 2), rel=1e-5)


def test_absorption_is_by_length_and_thin_walls_have_none():
    green = replace(GLASS, ior=1.0, attenuation_distance_m=0.5, attenuation_colour=(0.5, 1, 0.25))
    seen = paths(made((box(2, 1), green), (wall(6.0), GLOW)), RAYS[:1])
    shares = np.array(green.attenuation_colour) ** 2
    np.testing.assert_allclose(seen.specular[0], shares * GLOW.emission)
    pane = replace(green, thin_walled=True, ior=1.5, diffuse=(0.5, 1, 1))
    seen = paths(made((wall(2.0), pane), (wall(6.0), GLOW), (wall(-1.0), GLOW)), RAYS[:1])
    back = 0.08 / 1.04
    shares = back + (1 - back) * np.array(pane.diffuse)
    np.testing.assert_allclose(seen.specular[0], shares * GLOW.emission)
    assert seen.inverse_depth[0] == pytest.approx(1 / 6)


def test_a_coat_and_a_veil_add_to_what_is_below():
    body = Material("body", (0.5,) * 3, (0,) * 3, clearcoat=0.5)
    veil = Material("veil", (0.5,) * 3, opacity=0.3)
    world = made((wall(2.0), body), (wall(-1.0), GLOW), ambient=WHITE)
    coated = paths(world, RAYS[:1])
    np.testing.assert_allclose(coated.own[0], 0.98 * 0.5)
    np.testing.assert_allclose(coated.specular[0], 0.02 * np.array(GLOW.emission))
    assert 1 / coated.own_inverse_depth[0] == pytest.approx(2)
    assert 1 / coated.inverse_depth[0] == pytest.approx(5)
    veiled = paths(made((wall(2.0), veil), (wall(6.0), GLOW), ambient=WHITE), RAYS[:1])
    np.testing.assert_allclose(veiled.own[0], 0.3 * 0.5)
    np.testing.assert_allclose(veiled.specular[0], 0.7 * np.array(GLOW.emission))
    assert 1 / veiled.inverse_depth[0] == pytest.approx(6)


def test_alpha_of_a_texture_is_a_share():
    texels = np.full((1, 2, 4), 255, np.uint8)
    texels[..., 3] = 51
    leaf = Material("leaf", WHITE, texture=0, alpha_blend=True, opacity=0.5)
    uvs = np.zeros((4, 3, 2), np.float32)
    world = made((wall(2.0), leaf), (wall(6.0), GLOW), textures=[texels], uvs=uvs, ambient=WHITE)
    np.testing.assert_allclose(paths(world).own, 0.1)
    texels[..., 3] = 0
    nothing = paths(world, most_events=0)
    np.testing.assert_allclose(nothing.own, np.tile(GLOW.emission, (3, 1)))
    np.testing.assert_allclose(nothing.own_inverse_depth, 1 / 6)


@pytest.mark.parametrize(
    "material",
    [
        MIRROR, GLASS, replace(GLASS, thin_walled=True), replace(GLASS, ior=2.4, opacity=0.5),
        Material("coat", WHITE, clearcoat=1.0), Material("veil", WHITE, opacity=0.25),
        Material("half", WHITE, metallic=0.5, roughness=0.0, transmission=0.5, clearcoat=0.5),
    ],
    ids=lambda material: material.name,
)  # fmt: skip
def test_white_things_vanish_in_white_light(material):
    """Whatever is cut, shares add up to one."""
    parts = [(box(2, 1, half=0.5), material), (box(2.2, 0.6, half=0.3), material)]
    parts += [(ball(4.5)[0], material)]
    world = made(*parts, ambient=WHITE, background=WHITE)
    rng = np.random.default_rng(1)
    rays = np.concatenate([np.zeros((60, 2)), rng.uniform(-0.3, 0.3, (60, 2))], 1)
    seen = paths(world, rays)
    # The last surface is matt: its diffuse and specular reflection add up to 1.02.
    np.testing.assert_allclose(seen.own + seen.specular, 1.0, rtol=2e-3)


def test_glass_in_glass_and_faces_that_coincide_are_one_glass():
    whole = paths(made((box(2, 2), GLASS), (wall(6.0), GLOW)))
    other = replace(GLASS, name="other")
    for parts in (
        [(box(2, 2), GLASS), (box(2.5, 1), GLASS)],
        [(box(2, 2), GLASS), (box(2.5, 1, half=2.0), other)],
        [(box(2, 1), GLASS), (box(3, 1), other)],
    ):
        seen = paths(made(*parts, (wall(6.0), GLOW)))
        np.testing.assert_allclose(seen.inverse_depth, whole.inverse_depth, rtol=1e-6)
        np.testing.assert_allclose(seen.specular, whole.specular, rtol=0.05)
    # Glass that lies on a wall shows it.
    seen = paths(made((box(2, 2), GLASS), (wall(4.0), GLOW)))
    assert (seen.specular > 0.9 * np.array(GLOW.emission)).all()


def test_grazing_rays_and_backs_of_volumes_stay_finite():
    flat = np.float32(wall(0.0, 20.0)[..., [0, 2, 1]])
    rays = [(0, 0, 0, y) for y in (1e-3, 1e-6, 1e-9)]
    for material in (MIRROR, GLASS, replace(GLASS, thin_walled=True)):
        for triangles in (
            flat + np.float32([0, 1e-3, 20]),
            flat[:, ::-1] + np.float32([0, 1e-3, 20]),
        ):
            seen = paths(made((triangles, material), background=WHITE), rays)
            for values in (seen.own, seen.specular, seen.inverse_depth, seen.cut):
                assert np.isfinite(values).all()
            assert (seen.inverse_depth <= NEAREST * seen.own_inverse_depth + 1e-12).all()
            np.testing.assert_allclose(seen.own + seen.specular, 1.0, rtol=1e-6)


@given(
    st.floats(0, 1),
    st.floats(0, 1),
    st.floats(1e-3, 0.999),
    st.floats(0.02, 0.35),
    st.floats(0, 6.3),
)
def test_facets_are_seen_and_weigh_at_most_one(first, second, cosine, roughness, turn):
    side = math.sqrt(1 - cosine**2)
    view = np.array([[side * math.cos(turn), side * math.sin(turn), cosine]])
    width, normal = np.array([roughness**2]), np.array([[0.0, 0, 1]])
    facet = visible_facets(normal, view, width, np.array([first]), np.array([second]))
    seen = float(facet[0] @ view[0])
    assert seen >= -1e-9 and facet[0, 2] >= -1e-9
    assert np.linalg.norm(facet) == pytest.approx(1)
    away = 2 * seen * facet[0] - view[0]
    assert 0 <= unhidden(away[2:], width)[0] <= 1


@pytest.mark.parametrize(("roughness", "cosine"), [(0.2, 0.9), (0.3, 0.5), (0.3, 0.15)])
def test_facets_reflect_what_the_integral_over_the_lobe_does(roughness, cosine):
    """Light that grows with height and to one side, reflected by white metal."""
    view = np.array([math.sqrt(1 - cosine**2), 0.0, cosine])
    alpha, n = roughness**2, 256

    def light(out):
        return 1 + out[..., 2] + 0.5 * out[..., 0]

    u, v = (each.ravel() for each in np.meshgrid(*[(np.arange(n) + 0.5) / n] * 2))
    normals = np.tile([0.0, 0, 1], (n * n, 1))
    facet = visible_facets(normals, np.tile(view, (n * n, 1)), np.full(n * n, alpha), u, v)
    out = 2 * (facet @ view)[:, None] * facet - view
    sampled = (light(out) * unhidden(out[:, 2], np.full(n * n, alpha))).mean()

    # Directly over halfway vectors: D G1 G1 (V . H) / (N . V) dH, reciprocal in V and L.
    tilt, turn = np.meshgrid(np.arctan(alpha * np.tan((np.arange(2000) + 0.5) / 2000 * np.pi / 2)),
                             (np.arange(256) + 0.5) / 256 * 2 * np.pi)  # fmt: skip
    step = np.gradient(tilt, axis=1)
    h = np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)], -1)
    density = alpha**2 / (np.pi * (np.cos(tilt) ** 2 * (alpha**2 - 1) + 1) ** 2)
    seen = np.maximum(h @ view, 0)
    out = 2 * seen[..., None] * h - view
    hidden = unhidden(out[..., 2], np.array(alpha)) * unhidden(np.array(cosine), np.array(alpha))
    whole = light(out) * density * hidden * seen / cosine * np.sin(tilt) * step * (2 * np.pi / 256)
    assert sampled == pytest.approx(whole.sum(), rel=3e-3)


@pytest.mark.parametrize("roughness", [0.031, 0.1, 0.3])
def test_rough_metal_in_white_light_is_nearly_white(roughness):
    """It loses what light scattered between facets would bring, as rougher metal under a sky."""
    metal = replace(MIRROR, roughness=roughness)
    world = made((wall(2.0), metal), ambient=WHITE, background=WHITE)
    rng = np.random.default_rng(2)
    rays = np.concatenate([np.zeros((500, 2)), rng.uniform(-0.5, 0.5, (500, 2))], 1)
    numbers = rng.integers(0, 2**32, (500, 2), np.uint32)
    seen = paths(world, rays, numbers=numbers)
    rough = reflected_shares().reshape(SHARES, SHARES, 3)[round(roughness * (SHARES - 1))]
    expected = rough[round(0.93 * (SHARES - 1))].sum()
    assert seen.specular.max() <= 1 + 1e-9
    assert seen.specular.mean() == pytest.approx(expected, abs=0.01)


def test_numbers_of_the_rays_of_a_pixel_have_all_strata():
    lens, pixel = 0.01, 0.003
    for views, side in ((1, 8), (2, 4), (4, 2), (8, 1), (16, 1)):
        i, j, u, v = (each.ravel() for each in np.mgrid[:views, :views, 5 : 5 + side, 9 : 9 + side])
        shear = -0.3 * lens * np.stack([i, j], 1)
        origins = (np.stack([i, j, 0 * i], 1) - (views - 1) / 2) * lens
        directions = np.stack([u, v, 0 * u], 1) * pixel
        directions[:, :2] += np.round(shear / pixel) * pixel
        numbers = ray_numbers(origins, directions, lens, pixel, min(3, views.bit_length() - 1))
        strata = (numbers >> 29).astype(int) @ [8, 1]
        assert set(np.bincount(strata, minlength=64)) == {(views * side) ** 2 // 64}
