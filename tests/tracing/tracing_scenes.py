"""Scenes for the tracer's tests.

A program is built for what a scene has, in seconds: most scenes have what :func:`lit_soup` has.
"""

import dataclasses
import math

import numpy as np
import plain_scenes
import trimesh

from lfcore import Scene, Slab
from lfcore.optics.bundles import macropixels
from lfcore.optics.plane_sums import total
from lfcore.oracle import colour as truth
from lfcore.oracle.shading import radiance
from lfcore.oracle.slab import all_pixels, slab_hits
from lfcore.rendering.tiles import trace_tile
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light, Material
from lfcore.scene.baked import BakedLight
from lfcore.scene.needs import Needs
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer

WALL = np.float32([[[-9, -9, 5], [9, -9, 5], [9, 9, 5]], [[-9, -9, 5], [9, 9, 5], [-9, 9, 5]]])
"""Two triangles that fill the picture, behind all others."""
CAMERA = dataclasses.replace(plain_scenes.CAMERA, f_number=1.0)


def scene(triangles, **changes):
    """A plain scene through a wider lens."""
    defaults = {"camera": CAMERA, "ambient": (0.2, 0.4, 0.6), "background": (0.7, 0.1, 0.3)}
    return plain_scenes.scene(triangles, **{**defaults, **changes})


def unit(*vector):
    """The direction of a vector, the same numbers on every processor."""
    return tuple(each / math.hypot(*vector) for each in vector)


LAMP = Light(POINT, (0.6, -1.5, 0.5), (0.9, 0.8, 0.7), 2.0)
SUN = Light(DIRECTIONAL, unit(-0.15, -0.25, -0.95), (0.7, 0.7, 0.7))


def soup(count, seed, size=0.3):
    """``count`` random triangles before the lens, from slivers to large."""
    rng = np.random.default_rng(seed)
    middle = rng.uniform([-0.7, -0.7, 0.6], [0.7, 0.7, 4.0], (count, 1, 3))
    return middle + rng.normal(size=(count, 3, 3)) * size * rng.random((count, 1, 1)) ** 3


def closed_room(subdivisions=3):
    """A sphere around the lens."""
    return trimesh.creation.icosphere(subdivisions, radius=3.0).triangles


def mesh(grid):
    """The triangles of a grid of corners (H, W, 3): two for each cell."""
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    return np.stack([a, b, c, a, c, d], 2).reshape(-1, 3, 3).astype(np.float32)


def bent_normals(triangles, rng, bend):
    """Corners' normals that turn from their triangle's by about ``bend``."""
    face = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals = face[:, None] / np.linalg.norm(face, axis=1)[:, None, None]
    normals = normals + rng.normal(size=triangles.shape) * bend
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    return normals.astype(np.float32)


def lit_soup(seed=3):
    """A soup before a wall, with smooth normals, vertex colours, gloss and a shadowing light."""
    rng = np.random.default_rng(seed)
    triangles = np.concatenate([soup(150, seed, 0.5), WALL]).astype(np.float32)
    return scene(
        triangles,
        normals=bent_normals(triangles, rng, 0.2),
        colours=rng.random((len(triangles), 3, 3)).astype(np.float32),
        materials=[Material("gloss", (0.7, 0.6, 0.5), (0.3, 0.3, 0.3), 20.0, (0.01, 0.02, 0.0))],
        lights=[Light(POINT, (1.0, -2.0, 0.5), (0.9, 0.8, 0.7), 2.0, True)],
    )


def flat(triangles, **changes):
    """A scene of flat white triangles that has what the lit soup has, and so its programs."""
    triangles = np.float32(triangles)
    normals = bent_normals(triangles, np.random.default_rng(0), 0.0)
    had = {"normals": normals, "colours": np.ones_like(triangles), "lights": [LAMP]}
    return scene(triangles, **{**had, **changes})


def tiles(z, size, count=12):
    """A wall of 2 count x count triangles, which blocks lie on or share."""
    y, x = np.mgrid[-count : count + 1, -count : count + 1] * size / count
    return mesh(np.stack([x, y, np.full_like(x, z)], -1))


def curved(lights, shininess=30.0, texture=None, bend=0.3):
    """A soup before a wall: smooth normals that turn by ``bend``, gloss, and a texture or none."""
    rng = np.random.default_rng(8)
    triangles = np.concatenate([soup(12, 5, 0.8), tiles(3.0, 0.9, 8), tiles(4.0, 9.0, 1)])
    gloss = (0.3, 0.3, 0.3)
    changes = {"lights": lights, "normals": bent_normals(triangles, rng, bend)}
    if texture is None:
        changes["colours"] = np.ones_like(triangles, np.float32)
    changes["materials"] = [Material("gloss", (0.7, 0.6, 0.5), gloss, shininess)]
    if texture is not None:
        changes["uvs"] = (triangles[..., :2] * 30).astype(np.float32)
        changes["textures"] = [texture]
        changes["materials"] = [Material("tiles", (0.7, 0.6, 0.5), gloss, shininess, texture=0)]
    return scene(triangles, **changes)


def baked(triangles, seed=1):
    """Random light, as points hold it, on grids of 1, 2, 4 and 7 cells, and a random sky."""
    rng = np.random.default_rng(seed)
    sides = rng.choice([1, 2, 4, 7], len(triangles))
    counts = (sides + 1) * (sides + 2) // 2
    ends = np.cumsum(2 * counts)
    grids = np.stack([ends - 2 * counts, ends - counts, sides], 1).astype(np.int32)
    values = rng.random((ends[-1], 3)).astype(np.float32)
    step = 2.0 ** (np.ceil(np.log2(values.max(1, keepdims=True))) - 9)
    values = (np.rint(values / step).clip(0, 511) * step).astype(np.float32)
    sky = rng.random((16, 16, 3)).astype(np.float32)
    return scene(triangles, light=BakedLight(grids, values), sky=sky)


def crowd():
    """Confetti of 4 mm out of focus: blocks of many triangles, lit past one another."""
    world, rng = lit_soup(), np.random.default_rng(9)
    middle = rng.uniform([-0.04, -0.04, 0.9], [0.04, 0.04, 1.2], (3000, 1, 3))
    small = middle + rng.normal(size=(3000, 3, 3)) * 0.002
    triangles = np.concatenate([small, world.triangles[-2:]])
    return scene(
        triangles,
        normals=np.concatenate([bent_normals(small, rng, 0.0), world.normals[-2:]]),
        colours=rng.random(triangles.shape).astype(np.float32),
        materials=world.materials,
        lights=world.lights,
        camera=dataclasses.replace(CAMERA, sensor_width_m=0.002),
    )


def painted_soup():
    """The lit soup in ambient light alone: its programs are built in less than half the time."""
    lit = lit_soup()
    return scene(lit.triangles, colours=lit.colours)


def tracer_of(world, device=None, *, specular=False, **options):
    """A tracer of a scene or of triangles, which takes texels as they are; without ``specular``
    rays end at mirrors, as in the oracle's shading."""
    world = world if isinstance(world, Scene) else scene(world)
    needs = Needs.of(world)
    if not specular:
        needs = dataclasses.replace(needs, specular=False, clear=False)
    tree = build_bvh(world.triangles)
    return Tracer(world, tree, device, needs, mipmaps=False, **options)


def traced(tracer, layout, planes=(), max_rays=1 << 30, frames=True):
    """All frames of all tiles, and the sums of the planes."""
    slab, made, parts = Slab.of(tracer.scene.camera, layout.views, layout.size), [], []
    for tile in layout.tiles(max_rays):
        tracing = trace_tile(tracer, slab, tile, planes, frames=frames)
        made += [chunk.frames.copy() for chunk in tracing if frames]
        parts.append(tracing.plane_sums)
    return np.concatenate(made) if made else None, total(slab, planes, parts) if planes else None


def every_ray(slab):
    """Every ray of a slab, pixel by pixel."""
    return macropixels(slab, all_pixels(slab))


def oracle_colours(world, bundles):
    """Colours of every ray, not clipped, by the oracle: (R, 3)."""
    return radiance(world, *(part.reshape(-1, 3) for part in bundles.rays()))


def colours(world, bundles, places=None, device=None, **options):
    """Colours of every ray by the tracer, not clipped, and by the oracle: (R, 3) each."""
    found = tracer_of(world, device, **options).bundle_radiance(bundles, places)
    return found.reshape(-1, 3), oracle_colours(world, bundles)


def slab_colours(world, slab, device=None, **options):
    """Likewise, of all pixels of a slab."""
    return colours(world, every_ray(slab), all_pixels(slab), device, **options)


def check_hits(tracer, slab, pixels, least=0.0):
    """Triangles are the oracle's but at edges, depths are within the rounding of float32."""
    triangle, depth = (found.ravel() for found in tracer.slab_hits(slab, pixels))
    expected = slab_hits(tracer.scene, slab, np.asarray(pixels))
    clear = expected.clear(16)
    assert (triangle == expected.triangle)[clear].all()
    same = (triangle == expected.triangle) & (expected.triangle >= 0) & clear
    assert same.mean() > least
    error = np.abs(depth[same] - expected.t[same]) / expected.t[same]
    assert (error <= 16 * 2.0**-24 * np.maximum(expected.grazing[same], 1)).all()


def check_luma(frames, layout, rays):
    """Luma is that of rays (F, height, width, 3), but where these graze edges."""
    luma = layout.format.views(frames, layout.frame_width, layout.frame_height)[0]
    expected = truth.ycbcr(truth.srgb_encode(rays))[..., 0]
    error = np.abs(luma[:, : expected.shape[1], : expected.shape[2]] - np.rint(expected))
    assert (error > 1).mean() < 2e-3 and error.mean() < 0.1
