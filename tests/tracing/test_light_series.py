"""Colours from truncated series, against the same computed ray by ray, and the oracle."""

import dataclasses

import numpy as np
import pytest
from tracing_scenes import CAMERA, scene, soup

from lfcore.optics.bundles import macropixels
from lfcore.optics.slab import Slab
from lfcore.oracle.shading import radiance
from lfcore.scene.model import DIRECTIONAL, POINT, Light, Material
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer

LAMP = Light(POINT, (0.6, -1.5, 0.5), (0.9, 0.8, 0.7), 2.0, True)
NEAR = Light(POINT, (0.01, 0.01, 2.985), (0.4, 0.4, 0.4), 0.0, False)
SUN = Light(DIRECTIONAL, (-0.15, -0.25, -0.95), (0.7, 0.7, 0.7))
GRAZING = Light(DIRECTIONAL, (1.0, 0.0, -0.1), (0.7, 0.7, 0.7), 0.0, False)
PIXELS = [[12, 11], [1, 22], [6, 17]]


class OneElement(Tracer):
    """Blocks of one element, whose series may cut off ``error`` of linear light."""

    def __init__(self, world, error, device=None):
        super().__init__(world, build_bvh(world.triangles), device, mipmaps=False)
        self.error = error

    def outer(self, bundles, work):
        return 1

    def _beam_kernel(self, file, name, shape, defines):
        return super()._beam_kernel(file, name, shape, {**defines, "LIGHT_ERROR": self.error})


def tiles(z, size, count=12):
    """A wall of 2 count x count triangles, which blocks lie on or share."""
    y, x = np.mgrid[-count : count + 1, -count : count + 1] * size / count
    a, b, c, d = (
        np.stack([i, j, np.full_like(i, z)], -1)
        for i, j in (
            (x[:-1, :-1], y[:-1, :-1]), (x[:-1, 1:], y[:-1, 1:]),
            (x[1:, 1:], y[1:, 1:]), (x[1:, :-1], y[1:, :-1]),
        )
    )  # fmt: skip
    return np.stack([a, b, c, a, c, d], 2).reshape(-1, 3, 3)


def curved(lights, shininess=30.0, texture=None, bend=0.3):
    """A soup before a wall: smooth normals that turn by ``bend``, gloss, and a texture or none."""
    rng = np.random.default_rng(8)
    triangles = np.concatenate([soup(12, 5, 0.8), tiles(3.0, 0.9, 60), tiles(4.0, 9.0, 1)])
    face = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals = face[:, None] / np.linalg.norm(face, axis=1)[:, None, None]
    normals = normals + rng.normal(size=triangles.shape) * bend
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    gloss = (0.3, 0.3, 0.3)
    changes = {"lights": lights, "normals": normals.astype(np.float32)}
    changes["materials"] = [Material("gloss", (0.7, 0.6, 0.5), gloss, shininess)]
    if texture is not None:
        changes["uvs"] = (triangles[..., :2] * 30).astype(np.float32)
        changes["textures"] = [texture]
        changes["materials"] = [Material("tiles", (0.7, 0.6, 0.5), gloss, shininess, texture=0)]
    return scene(triangles, **changes)


def noise():
    return np.random.default_rng(2).integers(0, 256, (16, 16, 3), np.uint8)


WORLDS = {
    "lamp": lambda: curved([LAMP]),
    "two lights": lambda: curved([LAMP, SUN]),
    "near light": lambda: curved([NEAR]),
    "terminator": lambda: curved([GRAZING]),
    "narrow highlights": lambda: curved([LAMP], 4000.0),
    "curled": lambda: curved([LAMP], bend=3.0),
    "textured": lambda: curved([LAMP], texture=noise()),
}
# Two lights, each 3e-5; texels that part by 1 at most where coordinates are off by 1e-3.
TOLERANCE = {"textured": 1e-3}


def colours(world, error, device=None, views=70):
    return colours_of(world, error, device, Slab(CAMERA, views, 24), PIXELS)


def colours_of(world, error, device, slab, pixels):
    return OneElement(world, error, device).bundle_radiance(macropixels(slab, pixels), pixels)


@pytest.mark.parametrize("name", WORLDS)
def test_series_are_as_good_as_they_say(device, name):
    world = WORLDS[name]()
    series = colours(world, "3.0e-5f", device)
    single = colours(world, "0.0f", device)
    assert (series != single).any()
    assert np.abs(series - single).max() <= TOLERANCE.get(name, 6e-5)


def test_what_series_would_cut_off_is_computed(device):
    """Without their limit the same scene is wrong: the limit is what keeps it right."""
    world = WORLDS["two lights"]()
    loose = colours(world, "1.0e9f", device)
    assert np.abs(loose - colours(world, "0.0f", device)).max() > 2e-3


def test_magnified_texture_is_the_oracles(device):
    world = curved([SUN], texture=noise(), bend=0.0)
    slab = Slab(CAMERA, 70, 24)
    found = colours(world, "3.0e-5f", device).reshape(-1, 3)
    origins, directions = macropixels(slab, PIXELS).rays()
    truth = radiance(world, origins.reshape(-1, 3), directions.reshape(-1, 3))
    error = np.abs(np.clip(found, 0, 1) - truth).max(1)
    assert np.quantile(error, 0.99) < 4e-3  # beside edges, which rounding moves
    assert truth.std() > 0.05


@pytest.mark.parametrize("scale", [3, 12, 60, 120, 400])
def test_patches_of_any_size(device, scale):
    """From one cell of the texture in a block to more than a patch holds, in the lamp's shadows."""
    world = curved([LAMP], texture=noise())
    world = dataclasses.replace(world, uvs=(world.triangles[..., :2] * scale).astype(np.float32))
    series, single = colours(world, "3.0e-5f", device), colours(world, "0.0f", device)
    assert (series != single).any()
    assert np.abs(series - single).max() <= 1e-3 * max(1, scale / 30)


def test_a_plane_through_the_lens_has_two_sides(device):
    """Some blocks of a beam see it from above and others from below: each in its own light."""
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
    found = colours_of(world, "3.0e-5f", device, slab, pixel)[0]
    truth = radiance(world, origins.reshape(-1, 3), directions.reshape(-1, 3)).reshape(found.shape)
    lit = truth[..., 0] > 0.3
    assert lit[rows > level + step].any() and not lit[rows < level - step].any()
    assert np.quantile(np.abs(found - truth).max(-1), 0.98) < 1e-4
