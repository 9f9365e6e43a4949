"""Shadow rays that start on the surface that smooth normals describe."""

import numpy as np
import pytest
import trimesh
from tracing_scenes import CAMERA, scene, unit

from lfcore.optics.bundles import views
from lfcore.optics.slab import Slab
from lfcore.oracle.shading import radiance
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light, Material
from lfcore.scene.needs import Needs
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer

pytestmark = pytest.mark.kernels

SUN = Light(DIRECTIONAL, unit(-1, -0.7, -0.15), (1.0, 1.0, 1.0))
LAMP = Light(POINT, (-3.2, -2.3, 1.1), (1.0, 1.0, 1.0))
BUNDLES = views(Slab(CAMERA, 3, 128), np.array([[1, 1]]))


def solid(mesh, normals, light=SUN, *, curved):
    return scene(
        mesh.triangles + [0, 0, 1.6],
        normals=np.float32(normals),
        materials=[Material("white", curved=curved)],
        lights=[light],
        ambient=(0.05, 0.05, 0.05),
        background=(0.0, 0.0, 0.0),
    )


def sphere(subdivisions, light=SUN, *, curved):
    mesh = trimesh.creation.icosphere(subdivisions, radius=0.45)
    return solid(mesh, mesh.triangles / 0.45, light, curved=curved)


def seen(world, **tracing):
    tracer = Tracer(world, build_bvh(world.triangles), **tracing)
    return tracer.bundle_radiance(BUNDLES)[0, ..., 0]


@pytest.mark.parametrize(("light", "share"), [(SUN, 8), (LAMP, 2.5)])
@pytest.mark.parametrize("tracing", [{}, {"single_rays": True}])
def test_a_coarse_sphere_is_shadowed_as_a_fine_one(light, share, tracing):
    """Where it faces the camera and light grazes it; what is left is the polyhedron's shape."""
    fine = seen(sphere(5, light, curved=False), **tracing)
    y, x = np.mgrid[:128, :128] - np.mean(np.nonzero(fine), axis=1)[:, None, None]
    grazed = (np.hypot(x, y) < 45) & (fine < 0.28)
    before, after = (
        (seen(sphere(2, light, curved=curved), **tracing) - fine)[grazed]
        for curved in (False, True)
    )
    assert before.std() > share * after.std()
    assert np.abs(before).max() > 0.08 and np.abs(after).max() < 0.012


def test_shadows_are_the_oracles():
    """Of both sides: the sphere's back is open."""
    ball = sphere(1, LAMP, curved=True)
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


def test_a_flat_cube_keeps_its_bits():
    mesh = trimesh.creation.box(
        (0.5, 0.5, 0.5), trimesh.transformations.rotation_matrix(1, [1, 2, 3])
    )
    normals = np.repeat(mesh.face_normals[:, None], 3, axis=1)
    worlds = [solid(mesh, normals, curved=curved) for curved in (False, True)]
    assert not Needs.of(worlds[1]).curved
    plain, curved = (seen(world) for world in worlds)
    assert plain.tobytes() == curved.tobytes() and np.ptp(plain) > 0.1
