"""Leaves, plants, shrubs, grass and trees, each with a count of triangles known beforehand."""

import numpy as np
from numpy.typing import ArrayLike

from lfcore.scene.procedural.basics import Parts, Range, Rng, Vector
from lfcore.scene.procedural.primitives import mesh_grid, quad, scattered
from lfcore.scene.procedural.turned import curve, tube
from lfcore.scene.surface_mesh import Surface, SurfaceMesh, join, normalise, xyz


def blade(
    length: float,
    width: float,
    surface: Surface,
    *,
    bend: float = 0.3,
    fold: float = 0.2,
    pieces: int = 3,
    widest: float = 0.4,
) -> SurfaceMesh:
    """A leaf from the origin along +y, facing +z, drooping towards +z; 4 * pieces - 2 triangles.

    ``bend`` is the droop and ``fold`` the depth of the midrib, relative to length and width;
    ``widest`` is where along its length the leaf has its full ``width``.
    """
    v = np.linspace(0, 1, pieces + 1)
    # Zero at both ends, one at `widest`: a beta curve.
    a, b = widest / (1 - widest), 1.0
    profile = v**a * (1 - v) ** b / (widest**a * (1 - widest) ** b)
    profile = np.maximum(profile, [0.08] + [0.0] * pieces)
    across = np.array([-0.5, 0.0, 0.5])[None, :] * width * profile[:, None]
    angle = bend * 2.0 * v
    along = np.cumsum(np.r_[0, np.cos(angle[1:])]) * length / pieces
    droop = np.cumsum(np.r_[0, np.sin(angle[1:])]) * length / pieces
    depth = droop[:, None] + fold * width * profile[:, None] * np.array([1.0, 0.0, 1.0])
    points = xyz(across, along[:, None], depth)
    return mesh_grid(points, surface, ((0.05, 0.5, 0.95), v), crease_deg=85.0)


def diamond(length: float, width: float, surface: Surface, *, fold: float = 0.25) -> SurfaceMesh:
    """The smallest leaf: 2 triangles folded along the midrib, from the origin along +y."""
    foot, tip = (0.0, 0.0, 0.0), (0.0, length, -0.1 * length)
    left, right = ((x, 0.45 * length, fold * width) for x in (-width / 2, width / 2))
    triangles = np.array([[foot, right, tip], [foot, tip, left]])
    uv = np.array([[[0.5, 0], [1, 0.45], [0.5, 1]], [[0.5, 0], [0.5, 1], [0, 0.45]]])
    return SurfaceMesh(triangles, surface, None, uv)


def orient(
    rng: Rng,
    positions: ArrayLike,
    directions: ArrayLike,
    sizes: ArrayLike,
    *,
    roll: float = np.pi,
    face: ArrayLike | None = None,
) -> np.ndarray:
    """(K, 4, 4) matrices that set a blade's foot on ``positions``, its +y along ``directions``.

    ``sizes`` (K,) scales; ``roll`` turns it about its own axis by up to that angle; with
    ``face`` (a direction, or one for each) its +z looks there as far as it can first.
    """
    positions = np.asarray(positions, np.float64)
    number = len(positions)
    y = normalise(np.broadcast_to(np.asarray(directions, np.float64), (number, 3)))
    face = np.broadcast_to(np.asarray((0.0, 1.0, 0.01) if face is None else face), (number, 3))
    x = np.cross(y, face)
    x = np.where(np.linalg.norm(x, axis=1, keepdims=True) > 1e-6, x, (1.0, 0.0, 0.0))
    x = normalise(x - y * (x * y).sum(1, keepdims=True))
    z = np.cross(x, y)
    angle = rng.uniform(-roll, roll, number)[:, None]
    x, z = np.cos(angle) * x + np.sin(angle) * z, np.cos(angle) * z - np.sin(angle) * x
    matrices = np.tile(np.eye(4), (number, 1, 1))
    size = np.broadcast_to(np.asarray(sizes, np.float64), number)[:, None, None]
    matrices[:, :3, :3] = np.stack([x, y, z], -1) * size
    matrices[:, :3, 3] = positions
    return matrices


def rosette(
    rng: Rng,
    number: int,
    leaf: SurfaceMesh,
    *,
    foot: Vector = (0, 0, 0),
    lift: Range = (0.2, 1.0),
    size: Range = (0.7, 1.0),
) -> SurfaceMesh:
    """Leaves that rise from one foot in a spiral, the inner ones steeper."""
    turn = np.arange(number) * 2.39996 + rng.uniform(-0.3, 0.3, number)
    rise = np.linspace(lift[1], lift[0], number) * np.pi / 2
    level = np.cos(rise)
    directions = xyz(np.cos(turn) * level * 0.9, np.sin(rise), np.sin(turn) * level * 0.9)
    outward = xyz(np.cos(turn), -0.4, np.sin(turn))
    scale = rng.uniform(*size, number)
    feet = np.asarray(foot) + directions * 0.02
    return scattered(leaf, orient(rng, feet, directions, scale, roll=0.25, face=outward))


def shrub(
    rng: Rng,
    number: int,
    leaf: SurfaceMesh,
    radii: Vector,
    *,
    centre: Vector = (0, 0, 0),
    size: Range = (0.7, 1.2),
) -> SurfaceMesh:
    """Leaves scattered through the outer part of an ellipsoid, pointing outwards and drooping."""
    directions = normalise(rng.normal(size=(number, 3)))
    depth = rng.uniform(0.55**3, 1, number) ** (1 / 3)
    positions = np.asarray(centre) + directions * np.asarray(radii) * depth[:, None]
    aim = directions + rng.normal(scale=0.5, size=(number, 3)) + (0, -0.15, 0)
    return scattered(leaf, orient(rng, positions, aim, rng.uniform(*size, number)))


def tuft(
    rng: Rng, number: int, surface: Surface, *, height: float = 0.25, radius: float = 0.05
) -> SurfaceMesh:
    """Grass: ``number`` bent blades of 2 triangles."""
    corners = [(-0.03, 0, 0), (0.03, 0, 0), (0.018, 0.6, 0.04), (0.0, 1.0, 0.22)]
    leaf = quad(corners, surface, [(0, 0), (1, 0), (0.8, 0.6), (0.5, 1)])
    turn, out = rng.uniform(0, 2 * np.pi, number), np.sqrt(rng.random(number))
    flat = xyz(np.cos(turn) * out, 0.0, np.sin(turn) * out)
    directions = (0, 1, 0) + flat * 0.45 + rng.normal(scale=0.10, size=(number, 3))
    sizes = rng.uniform(0.6, 1.1, number) * height
    return scattered(leaf, orient(rng, flat * radius, directions, sizes))


def stems(
    rng: Rng,
    number: int,
    surface: Surface,
    *,
    foot: Vector,
    spread: float,
    height: float,
    radius: float = 0.004,
) -> tuple:
    """Curved stalks of 12 triangles each, and the (number, 3) positions of their tips."""
    parts, tips = [], []
    for index in range(number):
        turn = index * 2.39996 + rng.uniform(-0.4, 0.4)
        out = spread * np.sqrt((index + 0.5) / number) * rng.uniform(0.8, 1.15)
        tall = height * rng.uniform(0.75, 1.1)
        tip = np.asarray(foot) + (np.cos(turn) * out, tall, np.sin(turn) * out)
        half = np.asarray(foot) + (np.cos(turn) * out * 0.3, tall * 0.6, np.sin(turn) * out * 0.3)
        parts.append(tube(curve([foot, half, tip], 3), radius, surface, segments=3, caps=False))
        tips.append(tip)
    return join(parts), np.array(tips)


def conifer(rng: Rng, needles: Surface, trunk: Surface, height: float) -> Parts:
    """A spruce of drooping star-shaped skirts: 6 * points * tiers + 12 triangles."""
    tiers, points = 6, 9
    skirts = []
    for tier in range(tiers):
        share = tier / (tiers - 1)
        base = height * (0.14 + 0.70 * share)
        top = base + height * (0.30 - 0.10 * share)
        reach = height * 0.24 * (1 - 0.86 * share) * rng.uniform(0.92, 1.08)
        angle = np.arange(2 * points) * np.pi / points + rng.uniform(0, 2)
        tip = np.where(np.arange(2 * points) % 2, 0.62, 1.0) * rng.uniform(0.86, 1.12, 2 * points)
        drop = np.where(np.arange(2 * points) % 2, 0.10, 0.0) * reach
        rim = xyz(np.cos(angle) * tip * reach, base + drop, np.sin(angle) * tip * reach)
        middle = rim * (0.42, 0, 0.42) + (0, base + 0.42 * (top - base), 0)
        peak = np.broadcast_to((0.0, top, 0.0), rim.shape)
        uv = np.linspace(0, 4, 2 * points + 1), (0.0, 0.6, 1.0)
        rows = np.stack([rim, middle, peak])
        skirts.append(mesh_grid(rows, needles, uv, close_columns=True, crease_deg=35.0))
    stem = tube([(0, 0, 0), (0, height * 0.3, 0)], height * 0.028, trunk, segments=6, caps=False)
    return [join(skirts), stem]


def flowers(
    rng: Rng, positions: np.ndarray, surface: Surface, *, size: float = 0.02, petals: int = 5
) -> SurfaceMesh:
    """Blossoms of ``petals`` bent petals of 2 triangles, turned roughly to the front."""
    corners = []
    for turn in np.arange(petals) * 2 * np.pi / petals:
        across = np.array([-np.sin(turn), np.cos(turn), 0]) * 0.42
        out = np.array([np.cos(turn), np.sin(turn), 0])
        left, right = 0.6 * out + across + (0, 0, 0.25), 0.6 * out - across + (0, 0, 0.25)
        tip = 1.05 * out + np.array([0, 0, 0.12])
        corners += [[np.zeros(3), right, left], [left, right, tip]]
    triangles = np.array(corners)
    blossom = SurfaceMesh(triangles, surface, None, triangles[..., :2] * 0.5 + 0.5)
    number = len(positions)
    aim = normalise(np.array((0, 0.5, 1)) + rng.normal(scale=0.45, size=(number, 3)))
    sideways = np.cross(aim, (0.3, 1.0, 0.1))
    scale = rng.uniform(0.8, 1.2, number) * size
    return scattered(blossom, orient(rng, positions, sideways, scale, roll=0.3, face=aim))
