"""Cases 5 and 6, shadows, and baked light.

Cases 5 and 6 are surfaces that shade themselves, and occluders that nearly touch.  Error: share of
wrongly dark or wrongly lit pixels; bound 0.

Baked light: stiff skies, rooms, colours and sizes, against closed forms.  Error: root mean square
over the picture, as a share of the true light.
"""

import math
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from lfcore.evaluation.stability import naive
from lfcore.evaluation.stability.measurement import Bound, Measurement, measured, sweep
from lfcore.evaluation.stability.shapes import Rays, grid, one_by_one, single, sphere
from lfcore.evaluation.stability.tested_tracer import TracerUnderTest, bare_scene
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.oracle.slab import all_pixels, slab_hits, slab_rays, trace
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light, Material
from lfcore.scene.baked import BakeOptions
from lfcore.scene.model import Scene
from lfcore.scene.sky import radiance, solid_angles, texel_directions, under

CONVEX = Bound(0, "share of pixels", "a convex body does not shade itself")
WHITE = [Material("white", diffuse=(1.0, 1.0, 1.0))]


@sweep("5", "scale", [10.0**exponent for exponent in range(-4, 5)])
def self_shadow(tracer: TracerUnderTest, scale: float) -> Measurement:
    """Spheres of many sizes, lit from beside the camera: convex, so no part is shadowed."""
    mesh = single(sphere(12, 24, 0.5, (0, 0, 2.0)) * scale)
    light = Light(POINT, (-1.0 * scale, -1.5 * scale, 0.0), (1.0, 1.0, 1.0))
    return _shaded("self-shadow", CONVEX, tracer, mesh, light, 0.6, 1e-4, stop=max(1, 1 / scale))


@sweep("5", "D m", (1e1, 1e2, 1e3, 1e4))
def far_self_shadow(tracer: TracerUnderTest, distance: float) -> Measurement:
    """A sphere of 1 m ever farther from the camera, with ever larger rounding errors of hit
    points."""
    mesh = single(sphere(12, 24, 0.5, (0, 0, distance)))
    light = Light(POINT, (-1.0, -1.5, distance - 2.0), (1.0, 1.0, 1.0))
    return _shaded("self-shadow, far", CONVEX, tracer, mesh, light, 1.2 / distance, 1e-4, stop=1e4)


SLANT = 100.0
"""The length of a gap's shadow, in gaps."""


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
    light = Light(DIRECTIONAL, tuple(towards.tolist()), (1.0,) * 3)
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
    """Measure the share of pixels that are wrongly dark or wrongly lit.

    ``field`` is the tangent extent of the picture; ``stop`` multiplies f/2, so that the lens stays
    small beside a small scene; ``offset`` is the naive method's, metres.
    """
    camera = Camera(0.05, 0.05 * field, 2.0 * stop, float("inf"))
    slab = Slab(camera, 1, 32)
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
    clear &= (expected > 0.05 * expected.max()) | (expected == 0)

    def wrong(values: np.ndarray) -> float:
        return ((values > 0.5 * expected) != (expected > 0))[clear].mean()

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


PIXELS = 16
"""The side of pictures."""
HALF = 1.5
"""Half the width of a room, metres."""
DEPTH = 2.0
"""The depth of a room before the camera, metres."""
BACK = 1.0
"""The depth of a room behind the camera, metres."""
RAYS = 64
"""The naive method's random rays per point."""
MOST_RAYS = 1024
"""The most rays per point of a bake: few hit a narrow slit."""
WANTED = BakeOptions(bounces=0, error=0.05, cells=8)
REQUESTED = Bound(WANTED.error, "share of the light", "the requested error")
LEVEL = 0.5
"""The radiance of uniform skies: below white even with noise, because light above white needs
another program."""
BRIGHT = np.full((2, 2, 3), LEVEL, np.float32)


@sweep("21", "bright texel / sky", (1e1, 1e3, 1e5))
def bright_texel(tracer: TracerUnderTest, contrast: float) -> Measurement:
    """A wall under a sky with one ever brighter texel of 4096."""
    sky = np.full((64, 64, 3), 1 / contrast, np.float32)
    sky[4, 12] = 1.0  # behind the camera, up and to the left
    fine = 512
    towards = texel_directions(fine).reshape(-1, 3)
    cosine = np.maximum(-towards[:, 2], 0) * solid_angles(fine).ravel() / math.pi
    right = float(radiance(sky, towards)[:, 0].astype(np.float64) @ cosine)
    wall = grid(1, 1, [-HALF, -HALF, DEPTH], [2 * HALF, 0, 0], [0, 2 * HALF, 0])
    return _compared("bright texel", REQUESTED, tracer, _scene(single(wall), sky), right)


@sweep("22", "turn deg", (0.0, 10.0, 33.0))
def closed_room(tracer: TracerUnderTest, turn: float) -> Measurement:
    """A closed room in a bright sky is black; its walls are rotated about an oblique axis."""
    bound = Bound(0.0, "share of the sky's light", "a closed room is dark")
    axis = np.array([1.0, 2.0, 2.0]) / 3
    mesh = single(_room(0.0) @ Rotation.from_rotvec(turn * axis, degrees=True).as_matrix())
    return _compared("closed room", bound, tracer, _scene(mesh, BRIGHT, bounces=3), 0.0)


@sweep("23", "albedo", (0.5, 0.9, 0.99, 1.0))
def albedo(tracer: TracerUnderTest, share: float) -> Measurement:
    """A ball and a wall that emit as much of a uniform sky's light as they absorb."""
    ball = sphere(8, 16, 0.3, (0, 0, DEPTH - 0.5))
    wall = grid(1, 1, [-HALF, -HALF, DEPTH], [2 * HALF, 0, 0], [0, 2 * HALF, 0])
    scene = _scene(single(np.concatenate([ball, wall])), BRIGHT, share, bounces=8)
    return _compared("albedo", REQUESTED, tracer, scene, LEVEL)


@sweep("24", "slit m", (1.0, 0.1))
def slit(tracer: TracerUnderTest, width: float) -> Measurement:
    """A room 3 m wide, lit through a slit behind the camera."""
    return _lit_room("slit", tracer, width, 1.0)


@sweep("24", "scale", (1e-3, 1.0, 1e4))
def scaled_light(tracer: TracerUnderTest, scale: float) -> Measurement:
    """The room with a slit of 1 m, in many sizes."""
    return _lit_room("scaled light", tracer, 1.0, scale)


def _lit_room(case: str, tracer: TracerUnderTest, width: float, scale: float) -> Measurement:
    scene = _scene(single(_room(width) * scale), BRIGHT, scale=scale)
    share = _through_slit(width, scene.camera.field_width)
    hits = float(share.mean()) * MOST_RAYS
    bound = Bound(
        math.hypot(WANTED.error, 1 / math.sqrt(hits)), "share of the light",
        f"the requested error, or that of {MOST_RAYS} random rays",
    )  # fmt: skip
    return _compared(case, bound, tracer, scene, LEVEL * share)


def _through_slit(width: float, field: float) -> np.ndarray:
    """(PIXELS, PIXELS) share of the sky that the far wall sees through the slit: the integral of
    h^2 / (pi r^4) over it."""
    place, weight = np.polynomial.legendre.leggauss(48)
    x, y = place * width / 2, place * HALF
    area = weight[:, None] * weight * (width / 2 * HALF)
    at = DEPTH * field * ((np.arange(PIXELS) + 0.5) / PIXELS - 0.5)
    height = DEPTH + BACK
    apart = (at[:, None, None, None] - y[:, None]) ** 2 + (at[:, None, None] - x) ** 2
    return (area * height**2 / (math.pi * (apart + height**2) ** 2)).sum((-1, -2))


def _room(width: float) -> np.ndarray:
    """(T, 3, 3) walls around the camera, with a slit along y in the wall behind it."""
    side, long = 2 * HALF, DEPTH + BACK
    parts = [
        grid(1, 1, [-HALF, -HALF, DEPTH], [side, 0, 0], [0, side, 0]),
        grid(1, 1, [-HALF, -HALF, -BACK], [side, 0, 0], [0, 0, long]),
        grid(1, 1, [-HALF, HALF, -BACK], [side, 0, 0], [0, 0, long]),
        grid(1, 1, [-HALF, -HALF, -BACK], [0, side, 0], [0, 0, long]),
        grid(1, 1, [HALF, -HALF, -BACK], [0, side, 0], [0, 0, long]),
    ]
    strip = (side - width) / 2
    for start in (-HALF, HALF - strip) if width else (-HALF,):
        across = strip if width else side
        parts.append(grid(1, 1, [start, -HALF, -BACK], [across, 0, 0], [0, side, 0]))
    return np.concatenate(parts)


def _scene(
    mesh: np.ndarray, sky: np.ndarray, share: float = 1.0, scale: float = 1.0, bounces: int = 0
) -> Scene:
    material = Material("matt", diffuse=(share,) * 3, emission=(LEVEL * (1 - share),) * 3)
    camera = Camera(0.05 * scale, 0.012 * scale, 1e4, DEPTH * scale)
    scene = bare_scene(mesh, materials=[material], camera=camera, ambient=(0.0,) * 3)
    return replace(under(scene, sky), bake=replace(WANTED, bounces=bounces))


def _compared(
    case: str, bound: Bound, tracer: TracerUnderTest, scene: Scene, right: float | np.ndarray
) -> Measurement:
    """The error of the picture; naive: random rays to the sky."""
    slab = Slab(scene.camera, 1, PIXELS)
    whole = float(np.mean(right)) or 1.0

    def error(values: np.ndarray) -> float:
        return float(np.sqrt(np.mean((values - right) ** 2))) / whole

    def ours() -> float:
        plane = SensorPlane(scene.camera.focus_m, scene.camera.f_number)
        return error(tracer.picture(scene, slab, plane)[..., 0].astype(np.float64))

    return measured(case, bound, lambda: error(_by_chance(scene)), ours)


def _by_chance(scene: Scene) -> np.ndarray:
    """(PIXELS, PIXELS) light by random rays from a pinhole's hits."""
    mesh, material = scene.triangles, scene.materials[0]
    ticks = scene.camera.field_width * ((np.arange(PIXELS) + 0.5) / PIXELS - 0.5)
    x, y = np.meshgrid(ticks, ticks)
    eyes = np.stack([x, y, np.ones_like(x)], -1).reshape(-1, 3).astype(np.float32)
    ids, depth = naive.moeller_trumbore(mesh, np.zeros_like(eyes), eyes)
    normals = np.cross(mesh[ids, 1] - mesh[ids, 0], mesh[ids, 2] - mesh[ids, 0])
    normals *= -np.sign((normals * eyes).sum(-1, keepdims=True))
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    draws = np.random.default_rng(21).normal(size=(RAYS, len(eyes), 3))
    draws /= np.linalg.norm(draws, axis=-1, keepdims=True)
    light = np.zeros(len(eyes))
    for draw in draws:  # on a sphere tangent to the surface: density proportional to the cosine
        towards = (normals + draw).astype(np.float32)
        free = naive.moeller_trumbore(mesh, eyes * depth[:, None], towards, epsilon=1e-6)[0] < 0
        received = radiance(scene.sky, towards)[:, 0]
        light += np.where(free, received, 0) / RAYS
    return (material.emission[0] + material.diffuse[0] * light).reshape(PIXELS, PIXELS)
