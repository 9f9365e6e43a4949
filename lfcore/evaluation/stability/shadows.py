"""Cases 5 and 6: surfaces that shade themselves, and occluders that nearly touch.

Error: share of the pixels that are dark and should be lit or the other way round; bound 0.
"""

import numpy as np

from lfcore.evaluation.stability import naive
from lfcore.evaluation.stability.measurement import Bound, Measurement, measured, sweep
from lfcore.evaluation.stability.shapes import Rays, grid, one_by_one, single, sphere
from lfcore.evaluation.stability.tested_tracer import TracerUnderTest, bare_scene
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.oracle.slab import all_pixels, slab_hits, slab_rays, trace
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light, Material

PIXELS = 32
CONVEX = Bound(0, "share of pixels", "a convex body does not shade itself")
WHITE = [Material("white", diffuse=(1.0, 1.0, 1.0))]


@sweep("5", "scale", [10.0**exponent for exponent in range(-4, 5)])
def self_shadow(tracer: TracerUnderTest, scale: float) -> Measurement:
    """A sphere, lit from beside the camera, of ever other size: convex, so no part is shaded."""
    mesh = single(sphere(12, 24, 0.5, (0, 0, 2.0)) * scale)
    light = Light(POINT, (-1.0 * scale, -1.5 * scale, 0.0), (1.0, 1.0, 1.0))
    return _shaded("self-shadow", CONVEX, tracer, mesh, light, 0.6, 1e-4, stop=max(1, 1 / scale))


@sweep("5", "D m", (1e1, 1e2, 1e3, 1e4))
def far_self_shadow(tracer: TracerUnderTest, distance: float) -> Measurement:
    """A sphere of 1 m ever farther from the camera, whose hit points are rounded ever more."""
    mesh = single(sphere(12, 24, 0.5, (0, 0, distance)))
    light = Light(POINT, (-1.0, -1.5, distance - 2.0), (1.0, 1.0, 1.0))
    return _shaded("self-shadow, far", CONVEX, tracer, mesh, light, 1.2 / distance, 1e-4, stop=1e4)


SLANT = 100.0


@sweep("6", "gap m", (1e-1, 1e-2, 1e-3, 1e-4, 3e-5, 1e-5, 3e-6))
def thin_gap(tracer: TracerUnderTest, gap: float) -> Measurement:
    """A plate before a wall at 3 m, at a distance of ``gap``: its shadow is 100 gaps long.

    To 16 ulp of the distance, below which hit points themselves are uncertain.
    """
    return _gap("thin gap", tracer, 3.0, gap)


@sweep("6", "distance m", (1.0, 10.0, 1e2, 1e3, 1e4))
def thin_gap_far(tracer: TracerUnderTest, distance: float) -> Measurement:
    """A gap of 32 ulp of the distance, ever farther away."""
    return _gap("thin gap, far", tracer, distance, float(np.spacing(np.float32(distance))) * 32)


def _gap(case: str, tracer: TracerUnderTest, distance: float, gap: float) -> Measurement:
    towards = np.array([-SLANT, 0, -1]) / np.hypot(SLANT, 1)
    light = Light(DIRECTIONAL, tuple(towards.tolist()), (SLANT,) * 3)
    size = 20 * distance
    wall = grid(1, 1, [-size, -size, distance], [2 * size, 0, 0], [0, 2 * size, 0])
    plate = grid(1, 1, [-size / 2, -size / 2, distance - gap], [size / 2, 0, 0], [0, size, 0])
    mesh = single(np.concatenate([wall, plate]))
    field, kappa = 8 * SLANT * gap / distance, distance / gap
    bound = Bound(0, "share of pixels", "to 16 ulp of the distance; 32 ulp where it varies")
    return _shaded(case, bound, tracer, mesh, light, field, 1e-3, condition=kappa)


def _shaded(
    case: str,
    bound: Bound,
    tracer: TracerUnderTest,
    mesh: np.ndarray,
    light: Light,
    field: float,
    offset: float,
    *,
    stop: float = 1.0,
    condition: float = 1.0,
) -> Measurement:
    """``stop`` times f/2 keeps the lens small beside a small scene."""
    camera = Camera(0.05, 0.05 * field, 2.0 * stop, float("inf"))
    slab = Slab(camera, 1, PIXELS)
    scene = bare_scene(
        mesh,
        camera=camera,
        materials=WHITE,
        lights=[light],
        ambient=(0.0,) * 3,
        background=(0.5,) * 3,
    )
    pixels = all_pixels(slab)
    clear = slab_hits(scene, slab, pixels).clear()
    expected = trace(scene, slab, pixels)[:, 0, 0, 0]
    clear &= (expected > 0.05) | (expected == 0)

    def wrong(found: np.ndarray) -> float:
        return ((found > 0.5 * expected) != (expected > 0))[clear].mean()

    def by_naive() -> float:
        rays = one_by_one(slab_rays(slab, pixels))
        return wrong(_naive_picture(mesh, light, rays, np.float32(offset)))

    def ours() -> float:
        plane = SensorPlane(float("inf"), camera.f_number, "square")
        return wrong(tracer.picture(scene, slab, plane)[..., 0].ravel())

    return measured(case, bound, by_naive, ours, condition=condition)


def _naive_picture(mesh: np.ndarray, light: Light, rays: Rays, offset: np.float32) -> np.ndarray:
    """(R,) float32: cosine law with a shadow ray from the hit point moved ``offset`` along N."""
    number, t = naive.moeller_trumbore(mesh, *rays)
    hit = np.flatnonzero(number >= 0)
    colour = np.full(len(number), 0.5, np.float32)
    p, q, r = mesh[number[hit]].swapaxes(0, 1)
    normal = np.cross(q - p, r - p)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal *= -np.sign((normal * rays[1][hit]).sum(1, keepdims=True))
    point = rays[0][hit] + t[hit, None] * rays[1][hit]
    towards = np.tile(single(light.vector), (len(hit), 1))
    if light.kind == POINT:
        towards -= point
    cosine = (normal * towards).sum(1) / np.linalg.norm(towards, axis=1)
    blocker, distance = naive.moeller_trumbore(mesh, point + offset * normal, towards)
    dark = (blocker >= 0) & ((distance < 1) | (light.kind == DIRECTIONAL))
    colour[hit] = np.where(dark, 0, np.maximum(cosine, 0) * light.colour[0])
    return np.minimum(colour, 1)
