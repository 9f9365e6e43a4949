"""Shapes that scenes are made of: procedural ones and users' meshes, each in a sphere of radius 1.

Each is built once per process, from its name alone, so that a scene does not depend on which were
made before it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

import numpy as np

from lfcore.errors import SceneError
from lfcore.pictures import read_codes
from lfcore.scene.assemble import sound
from lfcore.scene.meshes import load_mesh
from lfcore.scene.procedural import furniture, textures, toys
from lfcore.scene.procedural.basics import Parts
from lfcore.scene.procedural.bedroom_surfaces import surfaces
from lfcore.scene.procedural.primitives import box, cushion, cylinder, lathe, ring, sphere, tube
from lfcore.scene.surface_mesh import Surface, SurfaceMesh, face_normals, transform_all
from lfcore.scene.transforms import rotate, scale, translate

UPRIGHT = ("ball", "blob", "tower", "train", "armchair", "plant", "table", "lamp", "globe")
"""Shapes that stand as they are built; others rest in one of their stable poses."""
LEAST_PROBABLE = 0.03
"""The least probability of a stable pose that counts."""
POOL = 32
"""The number of procedural textures of a data set."""
PLAIN = Surface("plain", curved=True)


@dataclass(frozen=True)
class Shape:
    """``parts`` are within radius 1 of the origin; ``poses`` rest on y = 0, with their shares.

    ``has_look`` is False where a material is to be drawn.
    """

    name: str
    parts: Parts
    poses: np.ndarray
    shares: np.ndarray
    has_look: bool


def _simple(name: str) -> Parts | None:
    made = {
        "ball": lambda: sphere(1.0, PLAIN, segments=48, rings=32),
        "block": lambda: box((1.3, 0.9, 1.1), PLAIN),
        "blob": lambda: cushion((1.4, 0.9, 1.1), PLAIN, pieces=16, power=3.0),
        "rod": lambda: cylinder((0, -1, 0), (0, 1, 0), 0.16, PLAIN, segments=24),
        "cone": lambda: lathe("0 0, 0.6 0, 0.02 1.2, 0 1.2", PLAIN, segments=40),
        "ring": lambda: tube(ring(0.75, 60), 0.22, PLAIN, segments=20, closed=True),
        "vase": lambda: lathe(
            "0 0, 0.045 0, 0.068 0.05, 0.072 0.1, 0.055 0.16, 0.036 0.19, 0.042 0.215, "
            "0.036 0.215, 0.03 0.18", PLAIN, segments=40, crease_deg=55,
        ),
    }.get(name)  # fmt: skip
    return [made()] if made else None


def _furnished(name: str) -> Parts:
    look, rng = surfaces(1), np.random.default_rng(1)
    if name == "tower":
        return toys.ring_tower()
    if name == "train":
        return toys.train()
    if name == "book":
        return furniture.book((0.05, 0.25, 0.18), 2, look["books"], look["paper"])
    if name == "armchair":
        return furniture.armchair(1, look)
    if name == "plant":
        return furniture.potted_plant(rng, look)
    if name == "table":
        return furniture.tulip_table(rng, look)
    return {"lamp": furniture.table_lamp, "globe": furniture.globe}[name](look)


@cache
def builder(name: str) -> Shape:
    """The procedural shape of one of :data:`lfcore.datasets.description.SHAPES`."""
    simple = _simple(name)
    return _shape(name, simple or _furnished(name), name in UPRIGHT, simple is None)


@lru_cache(maxsize=256)
def mesh(path: Path) -> Shape:
    """A user's mesh; raises :class:`SceneError` for one that cannot be read or traced."""
    parts = load_mesh(path)
    has_look = any(part.surface.has_textures or part.colours is not None for part in parts)
    return _shape(path.name, [_unwrapped(part) for part in parts], False, has_look)


def _unwrapped(part: SurfaceMesh) -> SurfaceMesh:
    """With texture coordinates from the nearest of six sides, where the part has none."""
    if part.uvs is not None:
        return part
    size = float(np.ptp(part.triangles.reshape(-1, 3), axis=0).max()) or 1.0
    along = np.abs(face_normals(part.triangles)).argmax(1)
    others = np.array([[2, 1], [0, 2], [0, 1]])[along]
    uvs = np.take_along_axis(part.triangles, others[:, None, :], axis=2) / size
    return SurfaceMesh(part.triangles, part.surface, part.normals, uvs, part.colours)


def _shape(name: str, parts: Parts, upright: bool, has_look: bool) -> Shape:
    kept = [part.picked(sound(part.triangles)[0]) for part in parts]
    kept = [part for part in kept if part.count]
    if not kept:
        raise SceneError("has no triangle that can be traced", file=name)
    points = np.concatenate([part.triangles.reshape(-1, 3) for part in kept])
    middle = (points.min(0) + points.max(0)) / 2
    radius = float(np.linalg.norm(points - middle, axis=1).max())
    unit = scale(1 / radius) @ translate(*-middle)
    points = (points - middle) / radius
    poses, shares = _standing(points) if upright else _stable(points)
    return Shape(name, transform_all(kept, unit), poses, shares, has_look)


def _standing(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return translate(0, -points[:, 1].min(), 0)[None], np.ones(1)


def _stable(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Poses at rest by trimesh, of the convex hull: meshes need not be closed for it."""
    import trimesh

    try:
        hull = trimesh.PointCloud(np.unique(points.round(3), axis=0)).convex_hull
        poses, shares = hull.compute_stable_poses(threshold=LEAST_PROBABLE)
    except Exception:  # Qhull refuses what is flat
        return _standing(points)
    if not len(poses):
        return _standing(points)
    found = rotate("x", -90) @ poses  # its floor is z = 0
    low = [(points @ pose[1, :3] + pose[1, 3]).min() for pose in found]
    return np.array([translate(0, -y, 0) @ p for y, p in zip(low, found, strict=True)]), shares


@lru_cache(maxsize=512)
def texture(source: Path | tuple[int, int]) -> np.ndarray:
    """(H, W, 3) uint8: a picture file, or procedural number ``source[1]`` of seed ``source[0]``."""
    if isinstance(source, Path):
        try:
            codes = read_codes(source)
        except Exception as error:
            raise SceneError(f"texture cannot be read: {error}", file=source) from None
        return np.ascontiguousarray(codes[..., :3] >> 8 if codes.dtype == np.uint16 else codes)
    seed, number = source
    rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=(number,))))
    drawn = rng.random((4, 3))
    first, *more = (128 * (drawn + drawn.mean(1, keepdims=True))).astype(int).tolist()
    dark, light = sorted((first, more[0]), key=sum)
    own, size = int(rng.integers(1 << 30)), (256, 256)
    kinds = (
        lambda: textures.speckle(own, (dark, light, more[1]), size=size),
        lambda: textures.weave(own, light, threads=24, depth=0.5),
        lambda: textures.wood(own, dark, light, size=size),
        lambda: textures.bricks(own, (dark, light), more[1], size=size),
        lambda: textures.stripes(own, (dark, light, *more[1:]), 1 + rng.integers(5, size=4)),
        lambda: textures.bark(own, dark, light),
        lambda: textures.speckle(own, (dark, light), cells=(40, 40), octaves=3, size=size),
        lambda: np.kron(
            (255 * rng.random((16, 16, 3))).astype(np.uint8), np.ones((16, 16, 1), np.uint8)
        ),
    )
    return kinds[number % len(kinds)]()
