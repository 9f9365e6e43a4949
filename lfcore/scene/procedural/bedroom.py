"""The bedroom scene: a sunny furnished room, toys on the rug in front, the bed behind them."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lfcore.scene.procedural import foliage, furniture, pictures, softgoods, textures, toys
from lfcore.scene.procedural.basics import Look, Parts, Rng, filled_to, painted, textured
from lfcore.scene.procedural.bicycle import wicker
from lfcore.scene.procedural.primitives import box, disc, quad, rectangle, scattered
from lfcore.scene.procedural.turned import cylinder, lathe, sphere, tube
from lfcore.scene.surface_mesh import Surface, SurfaceMesh, merge, transform_all, xyz
from lfcore.scene.transforms import chain, rotate, scale, translate

LEFT, RIGHT, BACK, FRONT, CEILING = -2.1, 2.1, -2.7, 3.6, 2.65
# The window in the left wall: z from, z to, sill, head.
WINDOW = (-1.35, 0.75, 0.62, 2.30)
SHEEPSKIN = chain(rotate("y", 12), translate(0.92, 0, -0.95))


def build(seed: int, *, triangles: int = 207000, closed: bool = False) -> Parts:
    """Exactly ``triangles`` of them; a sheepskin's fleece takes up what the rest leaves.

    The room is open towards +z, unless ``closed``.
    """
    rng = np.random.default_rng(seed)
    look = surfaces(seed)
    parts = _room(seed, look, closed) + _window(look, seed)
    parts += transform_all(furniture.bed(seed, look), translate(-0.42, 0, BACK + 0.06))
    parts += _beside_bed(look)
    shelf = furniture.bookshelf(rng, look, 0.98)
    parts += transform_all(shelf, translate(1.10, 0, BACK + 0.01))
    chair = furniture.armchair(seed + 50, look)
    parts += transform_all(chair, rotate("y", -42), translate(1.50, 0, -0.15))
    plant = furniture.potted_plant(rng, look)
    parts += transform_all(plant, translate(-1.62, 0, -2.2))
    carpet = softgoods.rug(1.9, 1.35, look["rug"], look["fringe"], seed=seed + 60)
    parts += transform_all(carpet, rotate("y", 4), translate(-0.15, 0, 0.42))
    parts += transform_all(toys.toy_corner(seed), rotate("y", 6), translate(0.14, 0.022, 0.84))
    bear = softgoods.teddy(look["fur"], look["light fur"], look["button"], seed=seed + 80)
    parts += transform_all(bear, rotate("y", 20), translate(-0.56, 0.022, 0.78))
    parts += _on_walls(seed, look) + _lantern(look)
    parts += transform_all(furniture.tulip_table(rng, look), translate(0.98, 0, 1.72))
    hide = disc((0, 0, 0), (0, 1, 0), 1.0, look["fleece"], segments=48)
    parts.append(hide.transformed(scale(0.33, 1, 0.5), SHEEPSKIN, translate(0, 0.006, 0)))
    unit = foliage.tuft(rng, 8, look["fleece"], height=0.045, radius=0.02)
    # Fleece is lit as one soft surface, not as hundreds of blades.
    unit = replace(unit, normals=np.broadcast_to((0.0, 1.0, 0.0), unit.triangles.shape))
    return merge(filled_to(triangles, parts, unit, lambda n: _sheepskin(rng, n, unit)))


def surfaces(seed: int) -> Look:
    """Woods, cloths and things."""

    def cloth(name: str, colour: ArrayLike, number: int, **more: Any) -> Surface:
        return textured(name, textures.weave(seed + number, colour, **more))

    white, blue, red = (236, 230, 216), (62, 96, 124), (196, 120, 96)
    tones = (white, blue, white, blue, white, red)
    stripes = textures.stripes(seed + 4, tones, (4, 1, 2, 1, 4, 2))
    curtain = textures.stripes(seed + 7, ((204, 194, 176), (178, 158, 130)), (3, 1), depth=0.08)
    leaf = textures.leaf(seed + 10, (26, 70, 40), (92, 150, 74))
    walnut = textures.wood(seed + 101, (70, 42, 26), (128, 84, 54), rings=6)
    oak = textures.wood(seed + 102, (158, 118, 76), (208, 170, 122), rings=6)
    return {
        "walnut": textured("walnut", walnut, 0.07, 35.0),
        "oak": textured("oak", oak, 0.05, 30.0),
        "brass": painted("brass", "#b28a3e", (0.5, 0.42, 0.25), 60.0),
        "linen": cloth("linen", (238, 232, 220), 1),
        "blush": cloth("blush cotton", (214, 152, 138), 2),
        "mustard": cloth("mustard cotton", (212, 158, 52), 3),
        "stripe": textured("striped cotton", stripes),
        "quilt": textured("quilt", pictures.patchwork(seed + 5)),
        "knit": textured("knitted throw", pictures.knitting(seed + 6, (196, 108, 78))),
        "velvet": painted("velvet", "#3f6570", 0.05, 8.0),
        "velvet 2": painted("ochre velvet", "#b8863b", 0.05, 8.0),
        "curtain": textured("curtain", curtain),
        "rug": textured("rug", pictures.rug_pattern(seed + 8)),
        "fringe": painted("fringe", "#e2d6bc"),
        "fleece": painted("fleece", "#e9e2d4"),
        "fur": painted("fur", "#a87542"),
        "light fur": painted("light fur", "#dcbf92"),
        "button": painted("button", "#241a16", 0.5, 80.0),
        "glaze": painted("glaze", "#4d7f86", 0.4, 70.0),
        "clay": painted("clay", "#bd6f4c"),
        "shade": painted("lamp shade", "#e8d3a8", emission=(0.42, 0.32, 0.18)),
        "paper lantern": painted("paper lantern", "#d6cab4"),
        "paper": painted("paper", "#ece3cd"),
        "books": textured("books", furniture.spine_atlas(seed + 9), 0.05, 25.0),
        "leaf": textured("plant leaf", leaf, (0.14, 0.15, 0.13), 35.0),
        "tulip": painted("tulip", "#e0526a", 0.06, 20.0),
        "stalk": painted("stalk", "#5b6b34"),
        "basket": textured("basket", wicker(seed + 11)),
        "earth": textured("globe", pictures.earth_map(seed + 12), 0.25, 60.0),
        "white": painted("white paint", "#efebe2", 0.06, 30.0),
    }


def _room(seed: int, look: Look, closed: bool) -> Parts:
    boards = textures.planks(seed + 20, (138, 98, 60), (190, 146, 98), rows=8)
    floor = textured("floor", boards, 0.06, 40.0, tone=0.95)
    paint = textured("wall", textures.plaster(seed + 21, (206, 208, 192), contrast=5), tone=0.95)
    paper = textured("wallpaper", pictures.wallpaper(seed + 22), tone=0.95)
    deep, wide, tall = FRONT - BACK, RIGHT - LEFT, CEILING
    z0, z1, sill, head = WINDOW
    parts = [
        rectangle((LEFT, 0, FRONT), (0, 0, -deep), (wide, 0, 0), floor, repeat=0.62),
        rectangle((LEFT, 0, BACK), (wide, 0, 0), (0, tall, 0), paper, repeat=1.05),
        rectangle((RIGHT, 0, BACK), (0, 0, deep), (0, tall, 0), paint, repeat=0.5),
        rectangle((LEFT, tall, BACK), (wide, 0, 0), (0, 0, deep), painted("ceiling", "#efece4")),
    ]
    if closed:
        parts.append(rectangle((RIGHT, 0, FRONT), (-wide, 0, 0), (0, tall, 0), paint, repeat=0.5))
    around = (BACK, z0, 0, tall), (z0, z1, 0, sill), (z0, z1, head, tall), (z1, FRONT, 0, tall)
    for start, end, low, high in around:
        across, up = (0, 0, start - end), (0, high - low, 0)
        parts.append(rectangle((LEFT, low, end), across, up, paint, repeat=0.5))
    for y, high, thick in ((0.06, 0.12, 0.022), (tall - 0.04, 0.08, 0.06)):
        middle, half = (BACK + FRONT) / 2, thick / 2
        parts.append(box((wide, high, thick), look["white"]).at(0, y, BACK + half))
        for x in (RIGHT - half, LEFT + half):
            parts.append(box((thick, high, deep), look["white"]).at(x, y, middle))
    return parts


def _window(look: Look, seed: int) -> Parts:
    z0, z1, sill, head = WINDOW
    white, x, middle, wide, tall = look["white"], LEFT - 0.09, (z0 + z1) / 2, z1 - z0, head - sill
    bars = [((0.06, tall, 0.07), (sill + head) / 2, z) for z in (z0 + 0.03, middle, z1 - 0.03)]
    bars += [((0.05, 0.05, wide), y, middle) for y in (sill + 0.03, sill + 0.62, head - 0.03)]
    bars += [((0.03, tall, 0.03), (sill + head) / 2, (z + middle) / 2) for z in (z0, z1)]
    parts = [box(size, white).at(x, y, z) for size, y, z in bars]
    parts.append(box((0.30, 0.035, wide + 0.16), white).at(LEFT + 0.06, sill - 0.018, middle))
    for za, ya, zb, yb in (
        (z0, sill, z0, head), (z1, sill, z1, head), (z0, sill, z1, sill), (z0, head, z1, head)
    ):  # fmt: skip
        corners = [(LEFT - 0.12, ya, za), (LEFT, ya, za), (LEFT, yb, zb), (LEFT - 0.12, yb, zb)]
        parts.append(quad(corners, white))
    x, y = LEFT + 0.10, head + 0.16
    parts.append(tube([(x, y, z0 - 0.55), (x, y, z1 + 0.55)], 0.014, look["brass"], segments=16))
    for z in (z0 - 0.57, z1 + 0.57):
        parts.append(sphere(0.03, look["brass"], segments=24, rings=16).at(x, y, z))
    for number, (start, pull) in enumerate(((z1 + 0.50, 1.0), (z0 + 0.22, -1.0))):
        size = 0.72, head + 0.10
        drape = softgoods.curtain(*size, look["curtain"], seed=seed + 1 - number, pull=pull)
        parts.append(drape.transformed(rotate("y", 90), translate(LEFT + 0.11, 0.04, start)))
    pot = lathe("0 0, 0.05 0, 0.065 0.1, 0.058 0.1, 0 0.09", look["clay"], segments=28)
    rng = np.random.default_rng(seed + 70)
    leaf = foliage.blade(0.13, 0.035, look["leaf"], bend=0.25, pieces=5, widest=0.3)
    for z in (-1.0, -0.35):
        plant = foliage.rosette(rng, 26, leaf, foot=(0, 0.09, 0), lift=(0.25, 1.0))
        parts += [pot.at(x, sill, z), plant.at(x, sill, z)]
    return parts


def _beside_bed(look: Look) -> Parts:
    parts = transform_all(furniture.night_table(look), translate(0.78, 0, BACK + 0.24))
    parts += transform_all(furniture.table_lamp(look), translate(0.85, 0.52, BACK + 0.20))
    for number in range(2):
        volume = furniture.book((0.035, 0.21, 0.15), 4 + 7 * number, look, lying=True)
        place = translate(0.58, 0.52 + 0.036 * number, BACK + 0.38)
        parts += transform_all(volume, rotate("y", 8 - 20 * number), place)
    profile = "0 0, 0.032 0, 0.036 0.01, 0.036 0.085, 0.032 0.085, 0.031 0.012, 0 0.01"
    return [*parts, lathe(profile, look["white"], segments=36).at(0.92, 0.52, BACK + 0.37)]


def _on_walls(seed: int, look: Look) -> Parts:
    """Three framed prints over the bed, a mirror on the right, a string of lights."""
    parts = []
    prints = (-1.02, 1.86, 0.46, 0.60), (-0.42, 1.92, 0.56, 0.72), (0.18, 1.86, 0.46, 0.60)
    for number, (x, y, width, tall) in enumerate(prints):
        picture = textured(f"print {number}", pictures.art_print(seed + 90 + number, number))
        low = (x - width / 2, y - tall / 2, BACK + 0.016)
        parts.append(rectangle(low, (width, 0, 0), (0, tall, 0), picture))
        for side in (-1, 1):
            upright = (x + side * width / 2, y, BACK + 0.02)
            parts.append(box((0.03, tall + 0.03, 0.04), look["oak"], grain=1).at(*upright))
            level = (x, y + side * tall / 2, BACK + 0.02)
            parts.append(box((width + 0.03, 0.03, 0.036), look["oak"]).at(*level))
    bulb = painted("bulb", "#e8cf90", emission=(0.75, 0.55, 0.28))
    pieces = []
    for k in range(4):
        t = np.linspace(0, 1, 16, endpoint=k == 3)
        along = -2.0 + (k + t) * 1.0
        pieces.append(xyz(along, 2.46 - 0.26 * (1 - (2 * t - 1) ** 2), BACK + 0.05))
    path = np.concatenate(pieces)
    parts.append(tube(path, 0.004, painted("wire", "#3a3a34"), segments=5))
    drop = sphere((0.018, 0.024, 0.018), bulb, segments=14, rings=10)
    matrices = [translate(*spot) for spot in path[2::4] - (0, 0.028, 0)]
    return [*parts, scattered(drop, np.array(matrices))]


def _lantern(look: Look) -> Parts:
    """A ribbed paper globe under the ceiling."""
    v = np.linspace(-np.pi / 2, np.pi / 2, 81)
    radius = 0.20 * np.cos(v) * (1 + 0.02 * np.abs(np.sin(v * 20)))
    profile = np.stack([np.maximum(radius, 0.05), 0.185 * np.sin(v)], -1)
    shell = lathe(profile, look["paper lantern"], segments=48, crease_deg=80)
    cord = cylinder((0, 0.18, 0), (0, CEILING - 2.18, 0), 0.006, look["white"], segments=8)
    return transform_all([replace(shell, uvs=None), cord], translate(0.92, 2.18, 0.25))


def _sheepskin(rng: Rng, number: int, unit: SurfaceMesh) -> SurfaceMesh:
    """Tufts over an oval with a nicked outline, beside the bed."""
    turn, out = rng.uniform(0, 2 * np.pi, number), np.sqrt(rng.random(number))
    shape = 1 + 0.13 * np.cos(2 * turn + 0.4) + 0.07 * np.cos(5 * turn)
    x, z = 0.34 * out * shape * np.cos(turn), 0.50 * out * shape * np.sin(turn)
    directions = xyz(0.5 * np.cos(turn) * out, 1.0, 0.5 * np.sin(turn) * out)
    sizes = rng.uniform(0.75, 1.3, number)
    matrices = foliage.orient(rng, xyz(x, 0.004, z), directions, sizes)
    return scattered(unit, matrices).transformed(SHEEPSKIN)
