"""Mirrors and glass, against closed forms: Fresnel's equations, unfolded rooms, layers of glass.

Error: of the light, as a share of what glows, or of the depth at which it appears, relative; the
largest of all rays.
"""

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lfcore.evaluation.stability import naive
from lfcore.evaluation.stability.measurement import Bound, Measurement, measured, sweep
from lfcore.evaluation.stability.shapes import Rays, grid, rays_at, single
from lfcore.evaluation.stability.tested_tracer import TracerUnderTest, bare_scene
from lfcore.scene.appearance import Material
from lfcore.scene.model import Scene

WHITE = (1.0, 1.0, 1.0)
GLOW = Material("glow", (0.0, 0.0, 0.0), emission=(0.5, 0.5, 0.5))
MIRROR: dict[str, Any] = {"metallic": 1.0, "roughness": 0.0}
IOR = 1.5
MOST_EVENTS = 8
"""The reflections and transmissions of a path that the tracer follows."""
LIGHT = Bound(
    2e-3, "share of the light",
    "reflections between two faces of glass, .04 squared, of which not all are followed",
)  # fmt: skip
EXACT = Bound(1e-5, "share", "16 roundings of each of 8 surfaces, 2^-24 each")
Part = tuple[np.ndarray, Material]
"""Triangles (T, 3, 3) of a material."""


@sweep("25", "degrees from grazing", (33.69, 10.0, 1.0, 0.1, 0.01))
def grazing_glass(tracer: TracerUnderTest, degrees: float) -> Measurement:
    """What a pond of black glass reflects of the sky, from Brewster's angle on ever flatter."""
    slope = math.tan(math.radians(degrees))
    reach = 4 / slope
    floor = grid(1, 1, [-2, 1, -1], [4, 0, 0], [0, 0, 2 * reach])
    ceiling = grid(1, 1, [-2, -2, -1], [4, 0, 0], [0, 0, 4 * reach])[:, ::-1]
    ink = _glass(attenuation_distance_m=1e-9, attenuation_colour=(0.0,) * 3)
    bottom = floor + [0, 1, 0]
    at = np.array([[x, 1.0, 1 / slope] for x in np.linspace(-0.3, 0.3, 20)])
    rays = rays_at(at, (0.0, 0.0))
    cosine = np.abs(rays[1][:, 1]) / np.linalg.norm(rays[1].astype(float), axis=1)
    right = fresnel(cosine, IOR)
    bound = Bound(1e-4, "share of the light", "16 roundings of a cosine, times Fresnel's slope")
    scene = _scene((floor, ink), (bottom, Material("black", (0.0,) * 3)), (ceiling, GLOW))
    return _light("grazing glass", bound, tracer, scene, rays, right)


@sweep("26", "levels", (1, 2))
def nested_glass(tracer: TracerUnderTest, levels: float) -> Iterator[Measurement]:
    """A slab of glass, and in it another: a wall seen through both appears nearer."""
    slabs = [(2.0, 1.0, IOR), (2.25, 0.5, 1.33)][: int(levels)]
    ends = [1.0, *(n for *_, n in slabs), *(n for *_, n in slabs[-2::-1]), 1.0]
    inner = slabs[1][1] if levels > 1 else 0.0
    nearer = (1.0 - inner) * (1 - 1 / IOR) + inner * (1 - 1 / 1.33)
    parts = [(_slab(z, thickness), _glass(ior=n)) for z, thickness, n in slabs]
    lost = sum(float(fresnel(1.0, b / a)) for a, b in pairwise(ends[2:]))
    bound = Bound(LIGHT.error + lost, LIGHT.unit, "the two first surfaces split light, others none")
    yield from _through("nested glass", tracer, parts, 6.0, nearer, ends, bound)


@sweep("27", "distance m", (1.0, 10.0, 1e2, 1e3, 1e4))
def touching_glass(tracer: TracerUnderTest, distance: float) -> Iterator[Measurement]:
    """Two slabs that touch are one, and a third is on what glows behind it."""
    t = distance / 8
    parts = [(_slab(distance + k * t, t), _glass(ior=IOR)) for k in range(3)]
    yield from _through(
        "touching glass", tracer, parts, distance + 3 * t, 3 * t * (1 - 1 / IOR), [1, IOR, 1]
    )


@sweep("28", "thickness m", (1.0, 1e-2, 1e-4, 1e-6))
def index_1(tracer: TracerUnderTest, thickness: float) -> Iterator[Measurement]:
    """Glass with the index of air is not there."""
    parts = [(_slab(2.0, thickness), _glass(ior=1.0))]
    yield from _through("index 1", tracer, parts, 6.0, 0.0, [1, 1], EXACT)


@sweep("29", "thickness m", (1.0, 1e-2, 1e-4, 1e-5, 1e-6))
def thin_slab(tracer: TracerUnderTest, thickness: float) -> Iterator[Measurement]:
    """An ever thinner slab at 2 m; 4 ulp at last."""
    parts = [(_slab(2.0, thickness), _glass(ior=IOR))]
    nearer = thickness * (1 - 1 / IOR)
    yield from _through("thin slab", tracer, parts, 6.0, nearer, [1, IOR, 1])


@sweep("30", "scale", [10.0**k for k in (-9, -6, -3, 0, 3, 6, 9)])
def scaled_mirror(tracer: TracerUnderTest, scale: float) -> Iterator[Measurement]:
    """A mirror at 2, and what glows 1 behind the camera: seen at 5, in many sizes."""
    mirror = _wall(2.0, 3.0) * scale, Material("mirror", WHITE, **MIRROR)
    scene = _scene(mirror, (_wall(-1.0, 9.0) * scale, GLOW))
    rays = _some_rays(tracer, scale)
    yield _light("scaled mirror (light)", EXACT, tracer, scene, rays, 1.0)
    yield _depth("scaled mirror (depth)", tracer, scene, rays, 5.0 * scale)


@sweep("31", "reflectance", (0.5, 0.9, 0.99, 1.0))
def facing_mirrors(tracer: TracerUnderTest, share: float) -> Iterator[Measurement]:
    """Two mirrors that glow face each other: a geometric series, as long as the path."""
    glows = Material("mirror", (share,) * 3, emission=(0.5,) * 3, **MIRROR)
    scene = _scene((_wall(2.0, 1e3), glows), (_wall(-1.0, 1e3)[:, ::-1], glows))
    rays = _some_rays(tracer)
    right = sum(share**k for k in range(1, MOST_EVENTS + 1))
    bound = Bound(1e-5 * MOST_EVENTS, "share of the light", "roundings of 8 reflections")
    yield _light("facing mirrors", bound, tracer, scene, rays, right)


def fresnel(cosine: ArrayLike, eta: float) -> np.ndarray:
    """The share of unpolarised light that glass of this relative index reflects, float64."""
    cosine = np.asarray(cosine, float)
    inside = np.sqrt(1 - (1 - cosine**2) / eta**2)
    across = (cosine - eta * inside) / (cosine + eta * inside)
    along = (eta * cosine - inside) / (eta * cosine + inside)
    return (across**2 + along**2) / 2


def _glass(**fields: ArrayLike) -> Material:
    return Material("glass", WHITE, transmission=1.0, **fields)  # type: ignore[arg-type]


def _wall(z: float, half: float) -> np.ndarray:
    """Two triangles across the axis whose front faces the camera."""
    return grid(1, 1, [-half, -half, z], [2 * half, 0, 0], [0, 2 * half, 0])[:, ::-1]


def _slab(z: float, thickness: float) -> np.ndarray:
    """Both faces of a slab; its sides are beyond the picture."""
    half = 4 * (z + thickness)
    return np.concatenate([_wall(z, half), _wall(z + thickness, half)[:, ::-1]])


def _scene(*parts: Part) -> Scene:
    meshes = [single(mesh) for mesh, _ in parts]
    ids = np.repeat(np.arange(len(parts), dtype=np.int32), [len(mesh) for mesh in meshes])
    return bare_scene(
        np.concatenate(meshes), materials=[material for _, material in parts], material_ids=ids,
        ambient=(0.0,) * 3, background=(0.0,) * 3, clip=False,
    )  # fmt: skip


def _some_rays(tracer: TracerUnderTest, scale: float = 1.0, spread: float = 1e-3) -> Rays:
    """Rays through a point of the lens, near the axis."""
    targets = np.random.default_rng(0).uniform(-spread, spread, (min(tracer.rays, 256), 2))
    return rays_at(np.concatenate([targets, np.ones((len(targets), 1))], 1) * scale, (0.0, 0.0))


def _through(
    case: str, tracer: TracerUnderTest, parts: list[Part], far: float, nearer: float,
    indices: list[float], bound: Bound = LIGHT,
) -> Iterator[Measurement]:  # fmt: skip
    """Light and depth of a glowing wall at ``far``, through media of these ``indices``."""
    scene = _scene(*parts, (_wall(far, 9 * far), GLOW))
    rays = _some_rays(tracer)
    passed = math.prod(1 - fresnel(1.0, b / a) for a, b in pairwise(indices))
    yield _light(f"{case} (light)", bound, tracer, scene, rays, passed)
    yield _depth(f"{case} (depth)", tracer, scene, rays, far - nearer)


def _light(
    case: str,
    bound: Bound,
    tracer: TracerUnderTest,
    scene: Scene,
    rays: Rays,
    right: float | np.ndarray,
) -> Measurement:
    def error(light: np.ndarray) -> float:
        return float(np.abs(light / GLOW.emission[0] - right).max())

    return measured(
        case, bound, lambda: error(naive.whitted(scene, *rays)[0]),
        lambda: error(tracer.specular(scene, *rays)[0][:, 0].astype(float)),
    )  # fmt: skip


def _depth(
    case: str, tracer: TracerUnderTest, scene: Scene, rays: Rays, right: float
) -> Measurement:
    def error(depth: np.ndarray) -> float:
        return float(np.abs(depth / right - 1).max())

    return measured(
        case, EXACT, lambda: error(naive.whitted(scene, *rays)[1]),
        lambda: error(tracer.specular(scene, *rays)[1].astype(float)),
    )  # fmt: skip
