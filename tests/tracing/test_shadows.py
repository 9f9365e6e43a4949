"""Shadows of blocks and of smooth surfaces, and points of surfaces that glow."""

import dataclasses
import functools

import numpy as np
import pytest
import trimesh
from tracing_scenes import (
    CAMERA,
    SUN,
    WALL,
    bent_normals,
    every_ray,
    flat,
    oracle_colours,
    scene,
    slab_colours,
    soup,
    tracer_of,
    unit,
)

from lfcore import SensorPlane, Slab
from lfcore.optics.bundles import macropixels, views
from lfcore.oracle.intersect import closest_hits
from lfcore.oracle.shading import radiance, shade
from lfcore.oracle.slab import all_pixels, slab_rays
from lfcore.rendering.tiles import trace_tile
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light, Material
from lfcore.scene.needs import Needs
from lfcore.storage.layout import FrameLayout
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer

pytestmark = pytest.mark.kernels

LAMP = Light(POINT, (0.6, -1.5, 0.5), (0.9, 0.9, 0.9))
NEAR = 4 * 2.0**-24
"""Of the depth: rays that lie so close to each other may differ by rounding."""
# Its plane passes through the lens: some rays of a packet see it from above, where the lamp is, and
# more from below.
FLOOR = [[[-9, -0.00925, 0.5], [9, -0.00925, 0.5], [0, -0.015, 12]]]
CANOPY = [[[0.19, -0.5, -1], [0.21, -0.5, 2.5], [2, -0.5, 0.8]]]


def crumbs(each):
    """Small triangles between the lamp and what nine pixels see of a wall: too many to keep."""
    rng = np.random.default_rng(4)
    lamp, across = np.array(LAMP.vector), np.linspace(-1.2, 1.2, 3)
    seen = np.stack([*np.meshgrid(across, across), np.full((3, 3), 5.0)], -1).reshape(9, 1, 1, 3)
    targets = seen + rng.uniform([-0.05, -0.05, 0], [0.05, 0.05, 0], (9, each, 1, 3))
    middle = lamp + (targets - lamp) * rng.uniform(0.6, 0.9, (9, each, 1, 1))
    return (middle + rng.normal(size=(9, each, 3, 3)) * 0.004).reshape(-1, 3, 3)


def one_element(world, device=None):
    """A tracer whose blocks are of one element each."""
    return tracer_of(world, device, spanning=False, single_rays=False)


def fan(depth, spokes=8, size=32.0):
    """Triangles around the axis at ``depth``: the first edge is level, the third upright."""
    turn = np.arange(spokes + 1) * 2 * np.pi / spokes
    rim = np.round(np.stack([np.cos(turn), np.sin(turn)], -1), 6) * size
    rim = np.concatenate([rim, np.full((spokes + 1, 1), depth)], -1)
    return np.stack([np.full((spokes, 3), [0.0, 0.0, depth]), rim[:-1], rim[1:]], 1)


WORLDS = {
    "lamp": (soup(40, 1, 0.5), WALL, [LAMP]),
    "sun": (soup(40, 2, 0.5), WALL, [SUN]),
    "both": (soup(40, 3, 0.5), WALL, [LAMP, SUN]),
    "edge-on": (CANOPY, FLOOR, [LAMP]),
    "many": (crumbs(250), WALL, [LAMP]),
    "dust": (soup(1000, 4, 0.05), WALL, [LAMP, SUN]),
}


def world(name):
    before, behind, lights = WORLDS[name]
    return scene(np.concatenate([before, behind]), lights=lights, ambient=(0.1, 0.1, 0.1))


def unlike(first, second):
    """(R,) bool: which colours (R, 3) differ by more than shading is rounded."""
    return np.abs(first - second).max(-1) > 0.01


@pytest.mark.parametrize("name", WORLDS)
def test_shadows_are_the_oracles(device, name):
    here, slab = world(name), Slab(CAMERA, 40, 3)
    found = one_element(here, device).bundle_radiance(every_ray(slab)).reshape(-1, 3)
    origins, directions = (part.reshape(-1, 3) for part in slab_rays(slab, all_pixels(slab)))
    hits = closest_hits(here.triangles, origins, directions)
    expected = shade(here, directions, hits)
    assert np.ptp(expected) > 0.15
    differ = np.flatnonzero(unlike(found, expected))
    assert len(differ) < 2e-3 * len(found)
    # Each of them passes an edge so closely that rays beside it are what the tracer found.
    beside = NEAR * np.where(hits.triangle >= 0, hits.t, 5.0)[differ]
    explained = np.zeros(len(differ), bool)
    for turn in np.arange(8) * np.pi / 4:
        aside = beside[:, None] * [np.cos(turn), np.sin(turn), 0.0]
        seen = radiance(here, origins[differ] + aside, directions[differ])
        explained |= ~unlike(found[differ], seen)
    assert explained.all()


@pytest.mark.parametrize("name", ["lamp", "sun", "edge-on", "many"])
def test_shadows_are_those_of_single_rays(name):
    """Of pixels whose rays fill many blocks: packets have screens, triangles part of a packet."""
    here, slab = world(name), Slab(CAMERA, 72, 24)
    rays = macropixels(slab, all_pixels(slab)[::29])
    tracers = one_element(here), tracer_of(here, single_rays=True)
    found, expected = (tracer.bundle_radiance(rays) for tracer in tracers)
    assert np.ptp(expected) > 0.15
    assert unlike(found, expected).mean() < 2e-5


@pytest.mark.parametrize("light", [(POINT, (0.0, 0.0, -2.0)), (DIRECTIONAL, (0.0, 0.0, -1.0))])
@pytest.mark.parametrize("views", [9, 65])
def test_no_light_comes_between_triangles(light, views):
    """Edges that occluders share run along rows, columns and diagonals of rays, to the last bit."""
    slab = Slab(CAMERA, views, 41)
    rays = macropixels(slab, np.array([[20, 20], [20, 3], [20, 31], [5, 20], [9, 9]]))
    dark, lit = (
        scene(triangles, lights=[Light(*light, (0.7, 0.7, 0.7))])
        for triangles in (np.concatenate([fan(-1.0), WALL]), WALL)
    )
    dark, lit = (one_element(each).bundle_radiance(rays) for each in (dark, lit))
    assert (dark == np.float32([0.1, 0.2, 0.3])).all()
    assert (lit > dark + 0.1).all()


@pytest.mark.parametrize("name", ["both", "many"])
def test_what_else_is_traced_changes_no_shadow(name):
    """Planes take packets by strips of pixels, frames alone one pixel after the other; without
    frames an aperture closes blocks, so that others are the first to ask for what casts shadows."""
    here, slab, plane = world(name), Slab(CAMERA, 72, 24), [SensorPlane(2.0, 2.8)]
    tracer = one_element(flat(here.triangles, lights=here.lights, ambient=here.ambient))
    tile, made = FrameLayout("macropixels", 72, 24, "raster", 1, "yuv444p").tile(0, 8, 24, 6), []
    for planes, frames in ((plane, True), ([], True), (plane, False)):
        tracing = trace_tile(tracer, slab, tile, planes, frames=frames)
        made.append(([chunk.frames.copy() for chunk in tracing], tracing.plane_sums.sums))
    (both, sums), (kept, _), (_, alone) = made
    assert np.ptp(kept) > 50
    np.testing.assert_array_equal(both, kept)
    np.testing.assert_array_equal(sums, alone)


GRAZING = Light(DIRECTIONAL, unit(-1, -0.7, -0.15), (1.0, 1.0, 1.0))
SIDE_LAMP = Light(POINT, (-3.2, -2.3, 1.1), (1.0, 1.0, 1.0))
BUNDLES = views(Slab(CAMERA, 3, 128), np.array([[1, 1]]))


def solid(mesh, normals, light=GRAZING, *, curved):
    return scene(
        mesh.triangles + [0, 0, 1.6],
        normals=np.float32(normals),
        materials=[Material("white", curved=curved)],
        lights=[light],
        ambient=(0.05, 0.05, 0.05),
        background=(0.0, 0.0, 0.0),
    )


def sphere(subdivisions, light=GRAZING, *, curved):
    mesh = trimesh.creation.icosphere(subdivisions, radius=0.45)
    return solid(mesh, mesh.triangles / 0.45, light, curved=curved)


def seen(world, **tracing):
    tracer = Tracer(world, build_bvh(world.triangles), **tracing)
    return tracer.bundle_radiance(BUNDLES)[0, ..., 0]


@pytest.mark.parametrize(("light", "share"), [(GRAZING, 8), (SIDE_LAMP, 2.5)])
@pytest.mark.parametrize("tracing", [{}, {"single_rays": True}])
def test_a_coarse_sphere_is_shadowed_as_a_fine_one(light, share, tracing):
    """Where it faces the camera and light grazes it; what is left is the polyhedron's shape."""
    fine = seen(sphere(5, light, curved=False))
    y, x = np.mgrid[:128, :128] - np.mean(np.nonzero(fine), axis=1)[:, None, None]
    grazed = (np.hypot(x, y) < 45) & (fine < 0.28)
    before = (seen(sphere(2, light, curved=False)) - fine)[grazed]
    after = (seen(sphere(2, light, curved=True), **tracing) - fine)[grazed]
    assert before.std() > share * after.std()
    assert np.abs(before).max() > 0.08 and np.abs(after).max() < 0.012


def test_curved_shadows_are_the_oracles():
    """Of both sides: the sphere's back is open."""
    ball = sphere(1, SIDE_LAMP, curved=True)
    front = ball.triangles[:, :, 0].max(1) < 0.2
    world = scene(
        ball.triangles[front],
        normals=ball.normals[front],
        materials=ball.materials,
        lights=ball.lights,
    )
    rays = (part[0].reshape(-1, 3).astype(np.float32) for part in BUNDLES.rays())
    expected = radiance(world, *rays)[:, 0].reshape(128, 128)
    assert (np.abs(seen(world) - expected) > 0.01).mean() < 2e-3
    assert (np.abs(expected - seen(world, needs=Needs.of(sphere(1, curved=False)))) > 0.1).any()


def test_shadows_of_a_sphere_around_the_lens_are_the_oracles():
    """Its coarse face is 5 mm before the lens, the surface that its normals describe behind it."""
    ball = trimesh.creation.icosphere(0, radius=0.1)
    ball.apply_transform(trimesh.geometry.align_vectors(ball.face_normals[0], [0, 0, -1]))
    ball.apply_translation([0, 0, 0.005 - ball.vertices[:, 2].min()])
    lit = Light(DIRECTIONAL, unit(-1, -0.7, -0.5), (1.0, 1.0, 1.0))
    card = np.array([[[-0.01, -0.5, -0.03], [-0.5, 0, -0.03], [-0.01, 0.5, -0.03]]])
    world = dataclasses.replace(
        sphere(0, lit, curved=True), triangles=np.float32([*ball.triangles, *card]),
        normals=np.float32([*ball.vertex_normals[ball.faces], np.tile([0, 0, 1], (3, 1))]),
        material_ids=np.zeros(21, np.int32),
    )  # fmt: skip
    rays = (part[0].reshape(-1, 3).astype(np.float32) for part in BUNDLES.rays())
    expected = radiance(world, *rays)[:, 0].reshape(128, 128)
    assert np.ptp(expected) > 0.1
    assert (np.abs(seen(world) - expected) > 0.01).mean() < 2e-3


def test_a_flat_cube_keeps_its_bits():
    mesh = trimesh.creation.box(
        (0.5, 0.5, 0.5), trimesh.transformations.rotation_matrix(1, [1, 2, 3])
    )
    normals = np.repeat(mesh.face_normals[:, None], 3, axis=1)
    worlds = [solid(mesh, normals, curved=curved) for curved in (False, True)]
    assert not Needs.of(worlds[1]).curved
    plain, curved = (seen(world) for world in worlds)
    assert plain.tobytes() == curved.tobytes() and np.ptp(plain) > 0.1


BEYOND = [[[-1, -1, -6], [1, -1, -6], [0, 1, -6]]]
WHITE = (0.9, 0.9, 0.9)
# By blocks of one element, one by one, and as the scene asks for.
WAYS = [{"spanning": False, "single_rays": False}, {"spanning": False, "single_rays": True}, {}]
# A sharp one and one that fades from its axis on: the wall has both rims in it.
AXIS = (0.1, 0.2, np.sqrt(0.95))
SPOTS = [
    Light(POINT, (-0.5, -0.5, 0.5), WHITE, 3.0, normal=AXIS, cone=(1.0, 0.96)),
    Light(POINT, (0.6, 0.5, 0.5), WHITE, 3.0, normal=AXIS, cone=(0.98, 0.979)),
]


def glowing(normals=False, spots=False):
    """A ball with a light inside and a panel, around it what casts shadows, before a wall."""
    ball = trimesh.creation.icosphere(1, radius=0.4).triangles + (0.5, -0.3, 3.0)
    triangles = np.concatenate([BEYOND, soup(30, 1, 0.5), ball, soup(20, 4, 0.5), WALL])
    inside = Light(POINT, (0.55, -0.25, 2.95), (0.8, 0.6, 0.4), 1.0, own=(31, 31 + len(ball)))
    # A point above a wall's panel, which it would see nothing through.
    panel = Light(POINT, (-1.0, -0.5, 2.0), WHITE, 2.0, normal=(0.6, 0.0, 0.8))
    changes = {"lights": SPOTS if spots else [inside, panel], "ambient": (0.1, 0.1, 0.1)}
    if normals:
        changes["normals"] = bent_normals(triangles, np.random.default_rng(3), 0.1)
        changes["materials"] = [Material("gloss", (0.6, 0.6, 0.6), (0.3, 0.3, 0.3), 20.0)]
    return scene(triangles, **changes)


RAYS = every_ray(Slab(CAMERA, 40, 4))


@functools.cache
def truth(spots):
    return oracle_colours(glowing(spots=spots), RAYS)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("spots", [False, True])
def test_emitters_and_spots_are_the_oracles(device, way, spots):
    here, expected = glowing(spots=spots), truth(spots)
    assert {(light.is_spot, light.is_of_emitter) for light in here.lights} == {(spots, not spots)}
    found = tracer_of(here, device, **way).bundle_radiance(RAYS).reshape(-1, 3)
    assert np.ptp(expected) > 0.15 and len(np.unique(expected.round(2))) > 10
    assert (expected == 0.05).mean() > 0.1 or not spots  # dark beside the cones
    assert (np.abs(found - expected).max(-1) > 0.01).mean() < 2e-3


def test_highlights_of_emitters_are_the_oracles(device):
    found, expected = slab_colours(glowing(normals=True), Slab(CAMERA, 16, 6), device, **WAYS[0])
    assert (np.abs(found - expected).max(-1) > 0.01).mean() < 4e-3
