"""Furniture of the bedroom: bed, night table, lamp, shelf, books, armchair, plant."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from PIL.ImageColor import getrgb

from lfcore.scene.procedural import foliage, textures
from lfcore.scene.procedural.basics import Look, Parts, Range, Rng
from lfcore.scene.procedural.primitives import box, cushion, mesh_grid, rectangle, scattered
from lfcore.scene.procedural.softgoods import draped, pillow, tufted
from lfcore.scene.procedural.turned import cylinder, lathe, ring, sphere, tube
from lfcore.scene.surface_mesh import Surface, SurfaceMesh, transform_all, xyz
from lfcore.scene.transforms import rotate, translate

TITLES = (
    "RAYS", "THE LIGHT FIELD", "OPTICKS", "LENSES", "FOCUS", "A CABIN", "BICYCLES", "SHADOWS",
    "COLOUR", "GARDENS", "BOTANY", "ATLAS", "NIGHT SKY", "POEMS", "TALES", "MAPS",
)  # fmt: skip
CLOTHS = (
    "#7c2f2a", "#24506b", "#c49a3a", "#3f6147", "#d8cdb4", "#54364f", "#b9623c", "#2f3338",
    "#8fa7a0", "#a33b4a", "#30587c", "#6f7a3a", "#1f3040", "#c98a86", "#5c4632", "#b8b09a",
)  # fmt: skip


def spine_atlas(seed: int) -> np.ndarray:
    """(512, 1024, 3) uint8: 16 book spines side by side, 64 texels each, titles reading down."""
    atlas = np.zeros((512, 1024, 3), np.uint8)
    for index, (title, cloth) in enumerate(zip(TITLES, CLOTHS, strict=True)):
        colour = getrgb(cloth)
        page = textures.weave(seed + index, colour, size=(512, 64), threads=32).copy()
        ink = (236, 214, 150) if sum(colour) < 420 else (60, 44, 36)
        for row in (40, 48, 440, 448, 470):
            page[row : row + 3] = ink
        size = min(34, int(620 / len(title)))
        page = textures.write(page, title, (240, 31), size, ink, turn=3)
        atlas[:, index * 64 : index * 64 + 64] = page
    return atlas


def book(size: Sequence[float], index: int, look: Look, *, lying: bool = False) -> Parts:
    """Spine to +z, standing on y = 0 with its left cover at x = 0; about 70 triangles."""
    thick, tall, deep = size
    angle = np.linspace(-np.pi / 2, np.pi / 2, 6)
    x = np.r_[0.0, thick / 2 + np.sin(angle) * thick / 2, thick]
    z = np.r_[-deep, np.cos(angle) * (0.18 * thick), -deep]
    points = np.stack([xyz(x, y, z) for y in (0.0, tall)])
    u = np.r_[0.002, np.linspace(0.004, 0.0585, 6), 0.0605] + (index % 16) / 16
    cover = mesh_grid(points, look["books"], (u, (0.0, 1.0)), crease_deg=50)
    inside, middle = (thick * 0.86, tall * 0.97, deep * 0.96), (thick / 2, tall / 2, -deep * 0.49)
    parts = [cover, box(inside, look["paper"]).at(*middle)]
    return transform_all(parts, rotate("z", 90), translate(tall, 0, 0)) if lying else parts


def book_row(rng: Rng, length: float, look: Look) -> Parts:
    """Books side by side from x = 0, spines to +z, the last one leaning."""
    parts, x, depth = [], 0.0, 0.2
    while x + (thick := rng.uniform(0.022, 0.052)) <= length - 0.05:
        size = (thick, rng.uniform(0.19, 0.285), depth * rng.uniform(0.82, 1.0))
        volume = book(size, int(rng.integers(16)), look)
        parts += transform_all(volume, translate(x, 0, depth + rng.uniform(-0.015, 0.01)))
        x += thick + 0.0015
    volume = book((0.03, 0.22, depth * 0.9), int(rng.integers(16)), look)
    return parts + transform_all(volume, rotate("z", 12), translate(x + 0.05, 0, depth))


def bed(seed: int, look: Look, detail: float = 1.0) -> Parts:
    """Headboard at z = 0, foot at z = 2.1; 1.6 m wide; four pillows, quilt and throw.

    Cloths have ``detail`` times as many pieces per side.
    """
    width, top, walnut = 1.6, 0.56, look["walnut"]
    mattress = cushion((width, 0.26, 2.04), look["linen"], pieces=14, power=9.0)
    parts = [
        tufted(width + 0.16, 0.85, look["velvet"]).at(0, 0.32, 0.0),
        box((width + 0.18, 1.12, 0.05), walnut).at(0, 0.62, -0.03),
        box((width + 0.08, 0.22, 2.06), walnut, grain=2).at(0, 0.24, 1.06),
        mattress.at(0, top - 0.13, 1.08),
    ]
    leg = lathe("0 0, 0.028 0, 0.042 0.14, 0 0.14", walnut, segments=12)
    parts += [leg.at(x, 0, z) for x in (-0.74, 0.74) for z in (0.1, 2.0)]
    covers: tuple[tuple[Any, ...], ...] = (
        (0.02, 1.36, (0.34, 0.34), "quilt", (120, 100), 0.62, 0.022),
        (0.05, 0.26, (0.30, 0.02), "linen", (90, 18), 2, 0.012),
        (0.07, 0.46, (0.38, 0.02), "knit", (110, 34), 1.6, 0.016),
    )  # wider than the bed, length, drop, surface, pieces, repeat, wrinkle
    quilt, fold, throw = (
        draped(width + more, length, drop, look[name], seed + number,
               (round(detail * pieces[0]), round(detail * pieces[1])), *how)
        for number, (more, length, drop, name, pieces, *how) in enumerate(covers, 1)
    )  # fmt: skip
    parts += [quilt.at(0, top + 0.035, 0.72), fold.at(0, top + 0.062, 0.66)]
    parts.append(throw.transformed(rotate("y", 3), translate(0.02, top + 0.082, 1.44)))
    pillows = (
        (-0.40, 0.22, 0.17, -66, 3, "linen", (0.70, 0.22, 0.48)),
        (0.40, 0.22, 0.17, -66, -4, "linen", (0.70, 0.22, 0.48)),
        (-0.38, 0.20, 0.33, -58, 6, "blush", (0.60, 0.20, 0.42)),
        (0.36, 0.20, 0.34, -57, -7, "stripe", (0.60, 0.20, 0.42)),
        (0.0, 0.15, 0.48, -52, 2, "mustard", (0.40, 0.17, 0.34)),
    )
    for number, (x, y, z, tilt, turn, name, size) in enumerate(pillows):
        soft = pillow(size, look[name], seed=seed + 10 + number, pieces=round(30 * detail))
        lean = rotate("x", -tilt), rotate("y", turn)
        parts.append(soft.transformed(*lean, translate(x, top + y, z)))
    return parts


def _legs(
    xs: Range, zs: Range, tall: float, lean: float, radii: list[float], wood: Surface, segments: int
) -> Parts:
    """Four legs, whose feet are ``lean`` times as far from the middle as their tops."""
    ends = [((x * lean, 0, z * lean), (x, tall, z)) for x in xs for z in zs]
    return [cylinder(*pair, radii, wood, segments=segments) for pair in ends]


def night_table(look: Look) -> Parts:
    """0.46 wide, 0.52 tall, front to +z."""
    walnut = look["walnut"]
    parts = [
        box((0.46, 0.03, 0.38), walnut).at(0, 0.505, 0),
        box((0.42, 0.24, 0.34), walnut).at(0, 0.37, 0),
        *(box((0.38, 0.095, 0.02), walnut).at(0, y, 0.175) for y in (0.43, 0.315)),
    ]
    knob = lathe("0 0, 0.008 0, 0.008 0.012, 0.016 0.02, 0 0.028", look["brass"], segments=14)
    for y in (0.43, 0.315):
        parts.append(knob.transformed(rotate("x", 90), translate(0, y, 0.185)))
    return parts + _legs((-0.19, 0.19), (-0.14, 0.14), 0.26, 1.08, [0.012, 0.02], walnut, 10)


def table_lamp(look: Look) -> Parts:
    """A ceramic foot and a pleated, glowing shade; 0.5 m tall."""
    profile = (
        "0 0, 0.075 0, 0.078 0.012, 0.05 0.03, 0.06 0.07, 0.085 0.13, 0.07 0.19, 0.03 0.235, "
        "0.018 0.26, 0.012 0.3, 0 0.3"
    )
    number = 180
    angle = -np.arange(number) * 2 * np.pi / number
    pleat = 1 + 0.025 * np.cos(angle * 45)
    rows = [
        xyz(np.cos(angle) * radius * pleat, y, np.sin(angle) * radius * pleat)
        for y, radius in ((0.27, 0.165), (0.34, 0.148), (0.42, 0.128), (0.50, 0.108))
    ]
    shade = mesh_grid(np.array(rows), look["shade"], None, close_columns=True, crease_deg=180)
    parts = [lathe(profile, look["glaze"], segments=40, crease_deg=60), shade]
    few = angle[::4]
    for y, radius in ((0.27, 0.166), (0.50, 0.109)):
        path = xyz(np.cos(few) * radius, y, np.sin(few) * radius)
        parts.append(tube(path, 0.004, look["brass"], segments=6, closed=True))
    return parts


def bookshelf(rng: Rng, look: Look, width: float) -> Parts:
    """Open shelves against a wall at z = 0, front to +z, filled with books and things."""
    deep, tall, wood = 0.26, 1.9, look["oak"]
    sides = [(x, tall / 2, deep / 2) for x in (0.0125, width - 0.0125)]
    parts = [box((0.025, tall, deep), wood, grain=1).at(*place) for place in sides]
    parts.append(rectangle((0, 0, 0.004), (width, 0, 0), (0, tall, 0), wood, repeat=1.0))
    levels = np.linspace(0.06, tall - 0.0125, 6)
    parts += [box((width - 0.05, 0.025, deep), wood).at(width / 2, y, deep / 2) for y in levels]
    fills = ((0.03, 0.62), (0.38, 0.66), (0.03, 0.46), (0.30, 0.74), (0.03, 0.55))
    for level, (start, length) in zip(levels[:-1], fills, strict=True):
        parts += transform_all(book_row(rng, length, look), translate(start, level + 0.0125, 0.03))
    profile = "0 0, 0.05 0, 0.075 0.07, 0.07 0.13, 0.03 0.19, 0.035 0.22, 0.028 0.22, 0 0.1"
    vase = lathe(profile, look["glaze"], segments=36, crease_deg=55)
    parts.append(vase.at(0.86, levels[0] + 0.0125, 0.14))
    parts += transform_all(globe(look), translate(0.20, levels[1] + 0.0125, 0.14))
    for number, x in enumerate((0.62, 0.66, 0.70)):
        volume = book((0.035, 0.24, 0.18), 3 + 5 * number, look, lying=True)
        parts += transform_all(volume, translate(x, levels[2] + 0.0125 + 0.036 * number, 0.22))
    trail = foliage.blade(0.10, 0.055, look["leaf"], bend=0.5, pieces=3)
    pot = lathe("0 0, 0.055 0, 0.07 0.11, 0.062 0.11, 0 0.1", look["clay"], segments=32)
    centre = (0.16, levels[3] + 0.17, 0.16)
    hanging = foliage.shrub(rng, 110, trail, (0.11, 0.12, 0.10), centre=centre)
    return [*parts, pot.at(0.16, levels[3] + 0.0125, 0.14), hanging]


def globe(look: Look) -> Parts:
    """A little globe of the Earth, 0.26 m tall."""
    profile = "0 0, 0.06 0, 0.05 0.02, 0.012 0.03, 0.01 0.06, 0 0.06"
    ball = sphere(0.085, look["earth"], segments=48, rings=30)
    meridian = tube(ring(0.094, 48), 0.004, look["brass"], segments=6, closed=True)
    tilt = rotate("y", 60), rotate("z", 23), translate(0, 0.155, 0)
    return [lathe(profile, look["walnut"], segments=30), *transform_all([ball, meridian], *tilt)]


def armchair(seed: int, look: Look, detail: float = 1.0) -> Parts:
    """0.78 wide, facing +z, seat at 0.42; ``detail`` as in :func:`bed`."""
    count = round(20 * detail)
    soft, arm = look["velvet 2"], (0.14, 0.38, 0.68)
    places = ((0.66, 0.20, 0.64), 0, 0.30, 0.03), (arm, -0.36, 0.38, 0.02), (arm, 0.36, 0.38, 0.02)
    parts = [
        cushion(size, soft, pieces=count, power=5.0, repeat=2.0).at(x, y, z)
        for size, x, y, z in places
    ]
    back = cushion((0.74, 0.62, 0.16), soft, pieces=round(24 * detail), power=4.5, repeat=2.0)
    parts.append(back.transformed(rotate("x", -10), translate(0, 0.60, -0.30)))
    parts.append(
        pillow((0.62, 0.20, 0.62), soft, seed=seed, pieces=round(28 * detail)).at(0, 0.44, 0.06)
    )
    loose = pillow((0.42, 0.17, 0.40), look["stripe"], seed=seed + 1, pieces=round(30 * detail))
    lean = rotate("x", 68), rotate("z", 8)
    parts.append(loose.transformed(*lean, translate(0.03, 0.64, -0.14)))
    return parts + _legs((-0.3, 0.3), (-0.26, 0.28), 0.22, 1.1, [0.014, 0.022], look["walnut"], 12)


def potted_plant(rng: Rng, look: Look) -> Parts:
    """A rubber plant in a basket; leaves on arching stalks."""
    profile = "0 0, 0.13 0, 0.17 0.1, 0.175 0.22, 0.15 0.3, 0.14 0.3, 0.13 0.25, 0 0.26"
    pot = lathe(profile, look["basket"], segments=44, crease_deg=50)
    assert pot.uvs is not None
    pot = replace(pot, uvs=pot.uvs * (6.0, 3.0))
    stalks, tips = foliage.stems(
        rng, 26, look["stalk"], foot=(0, 0.26, 0), spread=0.30, height=0.75, radius=0.006
    )
    leaf = foliage.blade(0.34, 0.17, look["leaf"], bend=0.45, fold=0.10, pieces=12, widest=0.42)
    outward = tips - (0, 0.62, 0)
    directions, sizes = outward * (1.0, 0.55, 1.0) + (0, 0.02, 0), rng.uniform(0.65, 1.05, 26)
    face = xyz(outward[:, 0], -0.35, outward[:, 2])
    matrices = foliage.orient(rng, tips, directions, sizes, roll=0.35, face=face)
    return [pot, stalks, scattered(leaf, matrices)]


def vase(surface: Surface) -> SurfaceMesh:
    """A vase for flowers, 0.215 m tall."""
    profile = "0 0, 0.045 0, 0.068 0.05, 0.072 0.1, 0.055 0.16, 0.036 0.19, 0.042 0.215"
    return lathe(f"{profile}, 0.036 0.215, 0.03 0.18", surface, segments=40, crease_deg=55)


def tulip_table(rng: Rng, look: Look) -> Parts:
    """A round side table, 0.62 tall, with a book, and tulips in a vase."""
    oak = look["oak"]
    profile = "0 0.59, 0.21 0.59, 0.225 0.6, 0.225 0.61, 0.215 0.62, 0 0.62"
    top = lathe(profile, oak, segments=60, repeat=1.5)
    stem = lathe("0.15 0, 0.14 0.02, 0.03 0.05, 0.02 0.59", oak, segments=32)
    stalks, tips = foliage.stems(
        rng, 9, look["stalk"], foot=(0, 0.15, 0), spread=0.13, height=0.27, radius=0.0045
    )
    profile = (
        "0 0, 0.018 0.004, 0.028 0.02, 0.029 0.04, 0.021 0.062, 0.017 0.058, 0.02 0.03, 0 0.012"
    )
    cup = lathe(profile, look["tulip"], segments=18, crease_deg=80)
    lean, sizes = tips - (0, 0.18, 0), rng.uniform(0.9, 1.15, 9)
    heads = scattered(cup, foliage.orient(rng, tips, lean, sizes))
    blade = foliage.blade(0.24, 0.045, look["leaf"], bend=0.5, fold=0.2, pieces=8, widest=0.4)
    leaves = foliage.rosette(rng, 9, blade, foot=(0, 0.18, 0), lift=(0.45, 0.95), size=(0.7, 1.0))
    bunch = [vase(look["glaze"]), stalks, heads, leaves]
    flowers = transform_all(bunch, translate(-0.05, 0.62, -0.03))
    volume = book((0.03, 0.20, 0.14), 1, look, lying=True)
    turned = transform_all(volume, rotate("y", 30), translate(0.02, 0.62, 0.17))
    return [top, stem, *flowers, *turned]
