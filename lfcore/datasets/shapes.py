"""The shapes and textures of data sets: procedural ones and the user's.

Shapes are scaled to a sphere of radius 1.  Each is built once per process, from its name alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from pathlib import Path

import numpy as np

from lfcore.errors import SceneError
from lfcore.readers.content import Played
from lfcore.readers.meshes import read_mesh
from lfcore.readers.side_files import read_texture
from lfcore.reading import Where
from lfcore.scene.assemble import sound
from lfcore.scene.procedural import furniture, textures, toys, vessels
from lfcore.scene.procedural.basics import Parts
from lfcore.scene.procedural.bedroom import surfaces
from lfcore.scene.procedural.primitives import box, cushion
from lfcore.scene.procedural.turned import cylinder, lathe, ring, sphere, tube
from lfcore.scene.surface_mesh import Surface, SurfaceMesh, face_normals, transform_all
from lfcore.scene.transforms import rotate, scale, translate

UPRIGHT = ("ball", "blob", "tower", "train", "armchair", "plant", "table", "lamp", "globe",
           *vessels.PROFILES, "pan")  # fmt: skip
"""The shapes that stand as they are built; others rest in one of their stable poses."""
LEAST_PROBABLE = 0.03
"""The least probability of a stable pose."""
THIN = 1e-9
"""The least distance of the centre of mass from the hull, of a shape of radius 1, in a solid."""
POOL = 32
"""The number of procedural textures of a data set."""
PLAIN = Surface("plain", curved=True)


@dataclass(frozen=True)
class Shape:
    """A shape.

    Attributes
    ----------
    name : str
        The builder's or the file's name.
    parts : list of SurfaceMesh
        The surfaces, within radius 1 of the origin.
    poses, shares : ndarray
        (P, 4, 4) poses at rest on y = 0, and (P,) their probabilities.
    has_look : bool
        Whether it has its own material; else a material is drawn.
    is_users : bool
        Whether it is a user's mesh.
    played : callable, optional
        The parts at a time after the start of the file's animation, seconds.
    """

    name: str
    parts: Parts
    poses: np.ndarray
    shares: np.ndarray
    has_look: bool
    is_users: bool = False
    played: Callable[[float], Parts] | None = None


@cache
def builder(name: str) -> Shape:
    """Build one of :data:`lfcore.datasets.description.SHAPES`."""
    simple: dict[str, Callable[[], SurfaceMesh]] = {
        "ball": lambda: sphere(1.0, PLAIN, segments=48, rings=32),
        "block": lambda: box((1.3, 0.9, 1.1), PLAIN),
        "blob": lambda: cushion((1.4, 0.9, 1.1), PLAIN, pieces=16, power=3.0),
        "rod": lambda: cylinder((0, -1, 0), (0, 1, 0), 0.16, PLAIN, segments=24),
        "cone": lambda: lathe("0 0, 0.6 0, 0.02 1.2, 0 1.2", PLAIN, segments=40),
        "ring": lambda: tube(ring(0.75, 60), 0.22, PLAIN, segments=20, closed=True),
    }
    if name in simple:
        return _shape(name, [simple[name]()], name in UPRIGHT, False)
    if name in (*vessels.PROFILES, "pan"):
        parts = vessels.pan(PLAIN) if name == "pan" else vessels.vessel(name, PLAIN)
        return _shape(name, parts, name in UPRIGHT, False)
    look, rng = surfaces(1), np.random.default_rng(1)
    furnished: dict[str, Callable[[], Parts]] = {
        "tower": toys.ring_tower,
        "train": toys.train,
        "book": lambda: furniture.book((0.05, 0.25, 0.18), 2, look),
        "armchair": lambda: furniture.armchair(1, look),
        "plant": lambda: furniture.potted_plant(rng, look),
        "table": lambda: furniture.tulip_table(rng, look),
        "lamp": lambda: furniture.table_lamp(look),
        "globe": lambda: furniture.globe(look),
    }
    return _shape(name, furnished[name](), name in UPRIGHT, True)


@lru_cache(maxsize=256)
def mesh(path: Path) -> Shape | SceneError:
    """Read a user's mesh; return the error if it cannot be read or traced."""
    try:
        return _mesh(path)
    except SceneError as error:
        return error


def _mesh(path: Path) -> Shape:
    content = read_mesh(path)
    parts = content.parts
    has_look = any(part.surface.has_textures or part.colours is not None for part in parts)
    shape = _shape(
        path.name, [_unwrapped(part) for part in parts], False, has_look, content.animation
    )
    return replace(shape, is_users=True)


def _unwrapped(part: SurfaceMesh) -> SurfaceMesh:
    """Return a part with texture coordinates; missing ones are by the nearest of six sides."""
    if part.uvs is not None:
        return part
    size = float(np.ptp(part.triangles.reshape(-1, 3), axis=0).max()) or 1.0
    along = np.abs(face_normals(part.triangles)).argmax(1)
    others = np.array([[2, 1], [0, 2], [0, 1]])[along]
    uvs = np.take_along_axis(part.triangles, others[:, None, :], axis=2) / size
    return SurfaceMesh(part.triangles, part.surface, part.normals, uvs, part.colours)


def _shape(
    name: str, parts: Parts, upright: bool, has_look: bool, animation: Played | None = None
) -> Shape:  # fmt: skip
    masks = [sound(part.triangles)[0] for part in parts]
    kept = [part.picked(mask) for part, mask in zip(parts, masks, strict=True)]
    points = np.concatenate([part.triangles.reshape(-1, 3) for part in kept])
    if not len(points):
        raise SceneError("has no triangle that can be traced", file=name)
    middle = (points.min(0) + points.max(0)) / 2
    radius = float(np.linalg.norm(points - middle, axis=1).max())
    unit = scale(1 / radius) @ translate(*-middle)
    points = (points - middle) / radius
    poses, shares = _standing(points) if upright else _stable(points)
    shape = Shape(name, transform_all(kept, unit), poses, shares, has_look)
    if animation is None:
        return shape

    def played(time_s: float) -> Parts:
        now = animation.at(min(animation.start_s + time_s, animation.end_s)).parts
        picked = [part.picked(mask) for part, mask in zip(now, masks, strict=True)]
        return transform_all(picked, unit)

    return replace(shape, played=played)


def _standing(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return translate(0, -points[:, 1].min(), 0)[None], np.ones(1)


def _stable(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return poses at rest by trimesh, of the convex hull, as meshes may be open."""
    import trimesh

    try:
        with np.errstate(invalid="ignore"):  # a flat hull has no centre of mass
            hull = trimesh.PointCloud(np.unique(points.round(3), axis=0)).convex_hull
            inwards = ((hull.triangles_center - hull.center_mass) * hull.face_normals).sum(1)
        if not inwards.min() > THIN:  # trimesh would look for a centre of mass for ever
            return _standing(points)
        poses, shares = hull.compute_stable_poses(threshold=LEAST_PROBABLE)
    except Exception:  # Qhull refuses most flat meshes
        poses = ()
    if not len(poses):
        return _standing(points)
    turned = rotate("x", -90) @ poses  # trimesh's floor is z = 0
    low = [(points @ pose[1, :3] + pose[1, 3]).min() for pose in turned]
    return np.array([translate(0, -y, 0) @ p for y, p in zip(low, turned, strict=True)]), shares


@lru_cache(maxsize=256)
def texture(path: Path) -> np.ndarray | SceneError:
    """Read a picture file as (H, W, 3) uint8; return the error if it cannot be read."""
    try:
        return read_texture(path, Where(path))
    except SceneError as error:
        return error


@lru_cache(maxsize=256)
def procedural_texture(seed: int, number: int) -> np.ndarray:
    """Make texture ``number`` of a seed, (H, W, 3) uint8."""
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
