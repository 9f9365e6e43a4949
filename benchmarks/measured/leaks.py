"""Rays aimed at the edges and vertices of closed surfaces: none may pass."""

import math
from collections.abc import Iterator
from functools import partial

import numpy as np
import trimesh
from scipy.spatial import Delaunay

from benchmarks.measured.rows import say
from lfcore.evaluation.stability.tested_tracer import bare_scene
from lfcore.optics.bundles import macropixels
from lfcore.optics.camera import Camera
from lfcore.optics.slab import Slab
from lfcore.timing import clocked
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer

CAMERA = Camera(focal_length_m=0.05, sensor_width_m=0.036, f_number=1.0, focus_m=2.0)
CHUNK_RAYS = 1 << 21
WALL_RAYS = 1 << 20
WALLS = (32, None), (64, 1)
"""Lens samples per side, and elements per block (None: chosen): packets of several elements, and of
one, which pack their triangles."""


def tracer_of(triangles: np.ndarray, outer: int | None = None) -> Tracer:
    scene = bare_scene(triangles, ambient=(1.0, 1.0, 1.0))
    return Tracer(scene, build_bvh(scene.triangles), outer=outer)


def closed_meshes() -> Iterator[tuple[str, np.ndarray]]:
    """(name, triangles): around the origin, corners shared to the last bit."""
    sphere = trimesh.creation.icosphere(4, radius=3.0)
    yield "sphere", sphere.triangles
    yield "box", trimesh.creation.box((5, 7, 9)).subdivide().subdivide().triangles
    rng = np.random.default_rng(1)
    rough = sphere.vertices * rng.uniform(0.4, 1.6, (len(sphere.vertices), 1))
    yield "rough sphere", rough.astype(np.float32)[sphere.faces]


def aimed(triangles: np.ndarray, count: int) -> int:
    """Misses of ``count`` single rays, half of them at vertices and half at edges."""
    tracer, rng, missed = tracer_of(triangles), np.random.default_rng(2), 0
    corners = tracer.scene.triangles
    for start in range(0, count, CHUNK_RAYS):
        some = min(CHUNK_RAYS, count - start)
        origins = rng.uniform(-0.5, 0.5, (some, 3)).astype(np.float32)
        face, side = rng.integers(0, len(corners), some), rng.integers(0, 3, some)
        along = rng.random((some, 1), np.float32)
        along[: some // 2] = 0
        aim = corners[face, side] * (1 - along) + corners[face, (side + 1) % 3] * along
        missed += int((tracer.closest_hit(origins, aim - origins)[0] < 0).sum())
    return missed


def rough_wall(slab: Slab, seed: int) -> np.ndarray:
    """A wall across the slab whose corners are on rays of the slab, at random depths."""
    rng, size, lens = np.random.default_rng(seed), slab.pixels, slab.views
    pixels = rng.integers(0, size, (6000, 2))
    origins, directions = macropixels(slab, pixels).rays()
    pick = np.arange(6000), rng.integers(0, lens, 6000), rng.integers(0, lens, 6000)
    inner = origins[pick] + directions[pick] * rng.uniform(2.4, 2.6, (6000, 1))
    # A frame beyond all rays closes it.
    frame = np.array([[x, y, 2.5] for x in (-9, 0, 9) for y in (-9, 0, 9) if x or y])
    corners = np.concatenate([inner, frame])
    return corners.astype(np.float32)[Delaunay(corners[:, :2]).simplices]


def through_wall(count: int) -> tuple[int, int]:
    """(rays, misses) of whole slabs before walls whose corners they hit; ``count`` rays or more."""
    traced = missed = seed = 0
    while traced < count:
        lens, outer = WALLS[seed % len(WALLS)]
        slab, side = Slab(CAMERA, 64, lens), math.isqrt(WALL_RAYS) // lens
        pixels = np.stack(np.meshgrid(*2 * [np.arange(side)]), axis=-1).reshape(-1, 2)
        triangle, _ = tracer_of(rough_wall(slab, seed), outer).slab_hits(slab, pixels)
        missed += int((triangle < 0).sum())
        traced, seed = traced + triangle.size, seed + 1
    return traced, missed


def leaks(options) -> list[dict]:
    """Misses among ``options.mrays`` million single rays, and as many rays of slabs."""
    rows, meshes = [], list(closed_meshes())
    share = -(-int(options.mrays * 1e6) // len(meshes))
    for name, triangles in meshes:
        say(f"{share} single rays in a {name}")
        missed, seconds = clocked(partial(aimed, triangles, share))
        rows.append(_row(name, len(triangles), "closest_hit", share, missed, seconds))
    say("slabs before walls")
    (traced, missed), seconds = clocked(lambda: through_wall(int(options.mrays * 1e6)))
    rows.append(_row("rough wall", None, "slab_hits", traced, missed, seconds))
    return rows


def _row(name: str, triangles, method: str, rays: int, misses: int, seconds: float) -> dict:
    """Seconds include making the rays."""
    return {
        "scene": name,
        "triangles": triangles,
        "method": method,
        "work": "leaks",
        "rays": rays,
        "misses": misses,
        "seconds": seconds,
    }
