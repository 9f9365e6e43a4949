"""Baked light: stiff skies, rooms, colours and sizes, against closed forms.

Error: root mean square over the picture, a share of the right light.
"""

import math
from dataclasses import replace

import numpy as np

from lfcore.evaluation.stability import naive
from lfcore.evaluation.stability.measurement import Bound, Measurement, measured, sweep
from lfcore.evaluation.stability.shapes import grid, single, sphere
from lfcore.evaluation.stability.tested_tracer import TracerUnderTest, bare_scene
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.scene.appearance import Material
from lfcore.scene.baked import BakeOptions
from lfcore.scene.model import Scene
from lfcore.scene.sky import octahedron, radiance, solid_angles, under

PIXELS, HALF, DEPTH, BACK = 16, 1.5, 2.0, 1.0
"""Of pictures; half of a room's width, its depth before and behind the camera, metres."""
RAYS = 64
"""The naive method's random rays per point."""
MOST_RAYS = 1024
WANTED = BakeOptions(bounces=0, error=0.05, cells=8)
ASKED = Bound(WANTED.error, "share of the light", "what was asked for")
BRIGHT = np.ones((2, 2, 3), np.float32)


@sweep("21", "bright texel / sky", (1e1, 1e3, 1e5))
def bright_texel(tracer: TracerUnderTest, contrast: float) -> Measurement:
    """A wall under a sky of which one texel of 4096 is ever brighter."""
    sky = np.ones((64, 64, 3), np.float32)
    sky[4, 12] = contrast  # behind the camera, up and to the left
    fine = 512
    axis = (np.arange(fine) + 0.5) / fine * 2 - 1
    towards = octahedron(np.stack(np.meshgrid(axis, axis), -1)).reshape(-1, 3)
    cosine = np.maximum(-towards[:, 2], 0) * solid_angles(fine).ravel() / math.pi
    right = float(radiance(sky, towards)[:, 0].astype(np.float64) @ cosine)
    wall = grid(1, 1, [-HALF, -HALF, DEPTH], [2 * HALF, 0, 0], [0, 2 * HALF, 0])
    return _compared("bright texel", ASKED, tracer, _scene(single(wall), sky), right)


@sweep("22", "turn deg", (0.0, 10.0, 33.0))
def closed_room(tracer: TracerUnderTest, turn: float) -> Measurement:
    """A closed room in a bright sky is black; its walls are turned about an axis askew."""
    bound = Bound(0.0, "share of the sky's light", "a closed room is dark")
    mesh = single(_room(0.0) @ _turned(math.radians(turn)))
    return _compared("closed room", bound, tracer, _scene(mesh, BRIGHT, bounces=3), 0.0)


@sweep("23", "albedo", (0.5, 0.9, 0.99, 1.0))
def albedo(tracer: TracerUnderTest, share: float) -> Measurement:
    """A ball before a wall, which glow with as much of an even sky's light as they absorb."""
    ball = sphere(8, 16, 0.3, (0, 0, DEPTH - 0.5))
    wall = grid(1, 1, [-HALF, -HALF, DEPTH], [2 * HALF, 0, 0], [0, 2 * HALF, 0])
    scene = _scene(single(np.concatenate([ball, wall])), BRIGHT, share, bounces=8)
    return _compared("albedo", ASKED, tracer, scene, 1.0)


@sweep("24", "slit m", (1.0, 0.1))
def slit(tracer: TracerUnderTest, width: float) -> Measurement:
    """A room 3 m wide, lit through a slit behind the camera."""
    return _lit_room("slit", tracer, width, 1.0)


@sweep("24", "scale", (1e-3, 1.0, 1e4))
def scaled_light(tracer: TracerUnderTest, scale: float) -> Measurement:
    """The room with a slit of 1 m, of ever other size."""
    return _lit_room("scaled light", tracer, 1.0, scale)


def _lit_room(case: str, tracer: TracerUnderTest, width: float, scale: float) -> Measurement:
    scene = _scene(single(_room(width) * scale), BRIGHT, scale=scale)
    right = _through_slit(width, scene.camera.field_width)
    hits = float(right.mean()) * MOST_RAYS
    bound = Bound(
        math.hypot(WANTED.error, 1 / math.sqrt(hits)), "share of the light",
        f"what was asked for, or what {MOST_RAYS} random rays leave",
    )  # fmt: skip
    return _compared(case, bound, tracer, scene, right)


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
    """(T, 3, 3) walls around the camera, with a slit along y in that behind it."""
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


def _turned(angle: float) -> np.ndarray:
    """(3, 3) rotation about (1, 2, 2) / 3."""
    axis = np.array([1.0, 2.0, 2.0]) / 3
    cross = np.cross(np.eye(3), axis)
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def _scene(
    mesh: np.ndarray, sky: np.ndarray, share: float = 1.0, scale: float = 1.0, bounces: int = 0
) -> Scene:
    material = Material("matt", diffuse=(share,) * 3, emission=(1 - share,) * 3)
    camera = Camera(0.05 * scale, 0.012 * scale, 1e4, DEPTH * scale)
    scene = bare_scene(mesh, materials=[material], camera=camera, ambient=(0.0,) * 3)
    return replace(under(scene, sky), bake=replace(WANTED, bounces=bounces))


def _compared(
    case: str, bound: Bound, tracer: TracerUnderTest, scene: Scene, right: float | np.ndarray
) -> Measurement:
    """Of the picture; naive: random rays that see the sky or nothing."""
    slab = Slab(scene.camera, 1, PIXELS)
    whole = float(np.mean(right)) or 1.0

    def error(found: np.ndarray) -> float:
        return float(np.sqrt(np.mean((found - right) ** 2))) / whole

    def ours() -> float:
        plane = SensorPlane(scene.camera.focus_m, scene.camera.f_number)
        return error(tracer.picture(scene, slab, plane)[..., 0].astype(np.float64))

    return measured(case, bound, lambda: error(_by_chance(scene)), ours)


def _by_chance(scene: Scene) -> np.ndarray:
    """(PIXELS, PIXELS) light of random rays from what a pinhole sees."""
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
    for draw in draws:  # on a sphere that touches the surface: as dense as the cosine
        towards = (normals + draw).astype(np.float32)
        free = naive.moeller_trumbore(mesh, eyes * depth[:, None], towards, epsilon=1e-6)[0] < 0
        sent = radiance(scene.sky, towards)[:, 0]
        light += np.where(free, sent, 0) / RAYS
    return (material.emission[0] + material.diffuse[0] * light).reshape(PIXELS, PIXELS)
