"""The bike scene: a city bicycle on cobbles, potted plants before it, a house front behind."""

from dataclasses import replace

import numpy as np

from lfcore.scene.procedural import foliage, textures
from lfcore.scene.procedural.basics import Parts, Rng, filled_to, painted, textured
from lfcore.scene.procedural.bicycle import bicycle
from lfcore.scene.procedural.primitives import box, quad, rectangle, scattered
from lfcore.scene.procedural.turned import cylinder, lathe, outline, sphere
from lfcore.scene.surface_mesh import Surface, SurfaceMesh, merge, transform_all, xyz
from lfcore.scene.transforms import chain, rotate, translate

WALL_Z = -2.35
PAVEMENT_Y = 0.09


def build(seed: int, *, triangles: int = 10000) -> Parts:
    """Exactly ``triangles`` of them; the ivy on the wall takes up what the rest leaves."""
    rng = np.random.default_rng(seed)
    place = chain(rotate("x", -2.5), rotate("y", 24), translate(0.05, 0, 0.0))
    parts = transform_all(bicycle(seed), place)
    parts += transform_all(_basket_load(seed), translate(0.52, 0.80, 0), place)
    parts += _ground(seed) + _house(seed)
    profile = "0 0, 0.12 0, 0.12 0.06, 0.09 0.1, 0.085 0.34, 0.1 0.36, 0.06 0.42, 0.045 0.6"
    iron = painted("cast iron", "#2f3a38", 0.2, 40.0)
    lamp_post = lathe(f"{profile}, 0.038 3.4", iron, segments=12)
    parts.append(lamp_post.at(-1.62, PAVEMENT_Y, -1.65))
    parts += _foreground(rng, seed) + _window_box(rng)
    texture = textures.leaf(seed + 10, (34, 70, 28), (104, 140, 56), size=(64, 64))
    ivy = textured("ivy", texture, (0.05, 0.06, 0.04), 20.0)
    leaf = foliage.diamond(0.14, 0.13, ivy, fold=0.12)
    return merge(filled_to(triangles, parts, leaf, lambda number: _ivy(rng, number, leaf)))


def _basket_load(seed: int) -> Parts:
    """Two baguettes, a bottle and apples."""
    tones = (150, 88, 34), (222, 164, 88), (240, 200, 130)
    bread = textured("bread", textures.speckle(seed + 40, tones, size=(128, 128)))
    profile = "0 0, 0.022 0.02, 0.031 0.08, 0.033 0.22, 0.03 0.34, 0.018 0.4, 0 0.415"
    loaf = lathe(profile, bread, segments=9)
    parts = [
        loaf.transformed(rotate("z", lean), translate(x, 0.03, z))
        for x, z, lean in ((-0.03, 0.05, 16.0), (0.03, 0.0, 8.0))
    ]
    profile = "0.0 0, 0.034 0, 0.036 0.17, 0.014 0.225, 0.013 0.29, 0.0 0.29"
    bottle = lathe(profile, painted("bottle", "#24472c", 0.5, 90.0), segments=12)
    parts.append(bottle.transformed(rotate("x", -9), translate(0.04, 0.03, -0.08)))
    apple = painted("apple", "#b8261f", 0.25, 50.0)
    places = (-0.05, 0.19, -0.06), (0.07, 0.18, 0.08), (-0.06, 0.185, 0.12)
    return parts + [sphere(0.038, apple, segments=10, rings=6).at(*at) for at in places]


def _ground(seed: int) -> Parts:
    stones = ((104, 98, 92), (138, 128, 116), (162, 148, 128), (120, 116, 118))
    sett = textures.cobbles(seed + 1, stones, (58, 54, 48), cells=9)
    street = textured("cobbles", sett, 0.05, 20.0, tone=0.92)
    tones, joint = ((150, 146, 140), (172, 168, 160)), (96, 92, 86)
    slab = textures.bricks(seed + 2, tones, joint, rows=4, columns=4, size=(256, 256), gap=0.03)
    stone = textures.plaster(seed + 3, (168, 164, 156), contrast=30)
    kerb = textured("kerb", stone, tone=0.9)
    edge, width = -1.35, 0.14
    pavement = (-5, PAVEMENT_Y, edge - width), (10, 0, 0), (0, 0, WALL_Z - edge + width)
    centres = [(-4 + index + 0.02, PAVEMENT_Y / 2, edge - 0.07) for index in range(9)]
    return [
        rectangle((-5, 0, 4), (10, 0, 0), (0, 0, WALL_Z - 4), street, repeat=0.95),
        rectangle(*pavement, textured("paving", slab, tone=0.9), repeat=0.8),
        *(box((0.985, PAVEMENT_Y + 0.004, 0.14), kerb).at(*centre) for centre in centres),
    ]


def _house(seed: int) -> Parts:
    """A brick wall with a plinth, a door and a shuttered window, cut out of four rectangles."""
    tones = ((98, 50, 42), (140, 70, 52), (168, 92, 66), (152, 84, 64), (122, 66, 58))
    courses = textures.bricks(seed + 4, tones, (166, 154, 138), rows=12, columns=6, gap=0.07)
    brick = textured("brick", courses, tone=0.95)
    sand = textures.plaster(seed + 5, (196, 180, 150), contrast=34)
    stone = textured("sandstone", sand, tone=0.95)
    parts = []
    # Openings: the door (x 0.95 .. 1.85, up to 2.1) and the window (x -1.25 .. -0.25, 1.0 .. 2.15).
    for left, right, low, high in (
        (-5, -1.25, 0.35, 4.0), (-1.25, -0.25, 0.35, 1.0), (-1.25, -0.25, 2.15, 4.0),
        (-0.25, 0.95, 0.35, 4.0), (0.95, 1.85, 2.15, 4.0), (1.85, 5, 0.35, 4.0),
    ):  # fmt: skip
        size = (right - left, 0, 0), (0, high - low, 0)
        sheet = rectangle((left, low, WALL_Z), *size, brick)
        # Texture coordinates from the position, so that courses run on across pieces.
        parts.append(replace(sheet, uvs=sheet.triangles[..., :2] * 0.9))
    for left, right in ((-5, 0.95), (1.85, 5)):
        centre = ((left + right) / 2, (0.35 + PAVEMENT_Y) / 2, WALL_Z + 0.01)
        parts.append(box((right - left, 0.35 - PAVEMENT_Y, 0.06), stone).at(*centre))
    return parts + _window(seed, stone) + _door(seed, stone)


def _window(seed: int, stone: Surface) -> Parts:
    left, right, low, high = -1.25, -0.25, 1.0, 2.15
    width, tall, back = right - left, high - low, WALL_Z - 0.14
    middle, centre_y = (left + right) / 2, (low + high) / 2
    pane = textured("pane", _pane(seed + 6), 0.35, 60.0)
    white = painted("window frame", "#ece6d8", 0.1, 40.0)
    bars = [((0.06, tall, 0.06), x, centre_y) for x in (left + 0.03, middle, right - 0.03)]
    heights = (low + 0.03, low + 0.42, low + 0.79, high - 0.03)
    bars += [((width, 0.05, 0.05), middle, y) for y in heights]
    parts = [
        rectangle((left, low, back), (width, 0, 0), (0, tall, 0), pane),
        box((width + 0.24, 0.09, 0.22), stone).at(middle, low - 0.045, WALL_Z + 0.02),
        box((width + 0.2, 0.16, 0.10), stone).at(middle, high + 0.08, WALL_Z + 0.01),
        *(box(size, white).at(x, y, back + 0.03) for size, x, y in bars),
        *_reveal(left, right, low, high, back, stone),
    ]
    shutter = painted("shutter", "#40684f", 0.08, 25.0)
    for x in (left - 0.27, right + 0.27):
        frame = [((0.06, tall, 0.045), x + dx, centre_y) for dx in (-0.22, 0.22)]
        frame += [((0.40, 0.08, 0.045), x, y) for y in (low + 0.04, centre_y, high - 0.04)]
        parts += [box(size, shutter).at(x, y, WALL_Z + 0.04) for size, x, y in frame]
        for index in range(14):
            y = low + 0.11 + index * 0.036 + (0.067 if index > 6 else 0) + index * 0.0335
            slat = rectangle((x - 0.2, y, WALL_Z + 0.05), (0.4, 0, 0), (0, 0.05, -0.035), shutter)
            parts.append(slat)
    return parts


def _reveal(
    left: float, right: float, low: float, high: float, back: float, stone: Surface
) -> Parts:
    """The sides, top and bottom of an opening, from the wall's face back to the pane or leaf."""
    corners = [(left, low), (right, low), (right, high), (left, high)]
    return [
        quad([(xa, ya, back), (xa, ya, WALL_Z), (xb, yb, WALL_Z), (xb, yb, back)], stone)
        for (xa, ya), (xb, yb) in zip(corners, corners[1:] + corners[:1], strict=True)
    ]


def _pane(seed: int) -> np.ndarray:
    """The picture in old glass: a dark room, a curtain, the sky's reflection."""
    v, u = np.mgrid[:128, :128] / 128.0
    wave = textures.noise(seed, cells=(3, 3), octaves=3, size=(128, 128))
    sky = np.clip(1.3 - 1.5 * v + 0.5 * (wave - 0.5) - 0.4 * u, 0, 1)
    picture = textures.ramp(sky, (38, 42, 48), (82, 100, 116), (168, 190, 206))
    curtain = (np.abs(u - 0.5) > 0.30 + 0.06 * np.cos(6 * v)) * (0.75 + 0.25 * np.sin(u * 90))
    curtain = curtain[..., None]
    return textures.finish(picture * (1 - 0.6 * curtain) + 150 * 0.6 * curtain)


def _door(seed: int, stone: Surface) -> Parts:
    left, right, high, low = 0.95, 1.85, 2.15, PAVEMENT_Y
    width, middle, back = right - left, (left + right) / 2, WALL_Z - 0.12
    x, y, _ = knob = left + 0.14, 1.08, back
    blue, size = ((44, 74, 110), (66, 100, 138)), (256, 256)
    wood = textures.planks(seed + 7, *blue, rows=5, size=size, stagger=False)
    leaf = textured("door", np.rot90(wood).copy(), 0.08, 30.0)
    brass = painted("brass", "#b8903c", (0.5, 0.42, 0.25), 60.0)
    plate = textures.blank_page((28, 56, 120), (64, 96))
    plate = textures.write(plate, "12", (48, 31), 52, (245, 245, 240))
    number = (middle - 0.12, high + 0.025, WALL_Z + 0.075), (0.24, 0, 0), (0, 0.15, 0)
    posts = [(x, (high + low) / 2, WALL_Z + 0.01) for x in (left - 0.07, right + 0.07)]
    return [
        rectangle((left, low, back), (width, 0, 0), (0, high - low, 0), leaf),
        box((width + 0.36, 0.2, 0.12), stone).at(middle, high + 0.1, WALL_Z + 0.01),
        box((width + 0.3, 0.12, 0.5), stone).at(middle, low + 0.06, WALL_Z + 0.18),
        sphere(0.035, brass, segments=10, rings=6).at(x, y, back + 0.06),
        cylinder(knob, (x, y, back + 0.05), 0.014, brass, segments=6, caps=False),
        *_reveal(left, right, low, high, back, stone),
        *(box((0.16, high - low, 0.12), stone, grain=1).at(*place) for place in posts),
        rectangle(*number, textured("number", plate, 0.2, 60.0)),
    ]


def _pot(radius: float, height: float, surface: Surface, earth: Surface, segments: int) -> Parts:
    size = radius, height
    shell = outline("0 0, 0.68 0, 0.92 0.8, 1.03 0.8, 1.06 1, 0.94 1, 0.9 0.88") * size
    soil = outline("0.9 0.88, 0 0.9") * size
    return [lathe(shell, surface, segments=segments), lathe(soil, earth, segments=segments)]


def _foreground(rng: Rng, seed: int) -> Parts:
    """Left a big leafy pot, right geraniums in terracotta and a crate, all nearer than the bike."""
    tones = (150, 78, 50), (190, 108, 74), (206, 132, 100)
    clay = textures.speckle(seed + 8, tones, size=(256, 256))
    terracotta = textured("terracotta", clay, tone=0.95)
    soil = painted("soil", "#3b2a1e")
    blade_texture = textures.leaf(seed + 9, (28, 74, 30), (112, 168, 70))
    green = textured("leaf", blade_texture, (0.1, 0.12, 0.08), 25.0)
    big = foliage.blade(0.52, 0.15, green, bend=0.55, fold=0.18, pieces=5)
    pot = _pot(0.20, 0.34, painted("glazed pot", "#2c5c8c", 0.45, 70.0), soil, 24)
    leaves = foliage.rosette(rng, 30, big, foot=(0, 0.31, 0), lift=(0.30, 0.98), size=(0.65, 1.05))
    parts = transform_all([*pot, leaves], translate(-0.72, 0, 1.35))
    small = foliage.blade(0.085, 0.085, green, bend=0.3, fold=0.15, pieces=2, widest=0.5)
    petal = painted("geranium", "#d3202f", 0.05, 10.0)
    radii, centre = (0.19, 0.12, 0.19), (0, 0.34, 0)
    for x, z, number in ((0.74, 1.40, 46), (1.02, 0.95, 34)):
        pot = _pot(0.15, 0.25, terracotta, soil, 20)
        pot.append(foliage.shrub(rng, number, small, radii, centre=centre, size=(0.8, 1.25)))
        heads = rng.normal(size=(9, 3)) * (0.11, 0.045, 0.11) + (0, 0.50, 0.03)
        blossoms = (heads[:, None] + rng.normal(scale=0.020, size=(9, 3, 3))).reshape(-1, 3)
        pot.append(foliage.flowers(rng, blossoms, petal, size=0.026, petals=4))
        parts += transform_all(pot, rotate("y", 40 * x), translate(x, 0, z))
    return parts


def _window_box(rng: Rng) -> Parts:
    wood = painted("window box", "#7b5433")
    petal = foliage.diamond(0.10, 0.06, painted("box leaf", "#3f7a35"))
    centre = (-0.75, 1.18, WALL_Z + 0.15)
    parts = [
        box((0.96, 0.15, 0.2), wood).at(-0.75, 1.08, WALL_Z + 0.14),
        foliage.shrub(rng, 70, petal, (0.46, 0.10, 0.12), centre=centre),
    ]
    for colour in ("#e8c33a", "#d8578c"):
        places = rng.uniform((-1.18, 1.20, WALL_Z + 0.10), (-0.32, 1.30, WALL_Z + 0.28), (9, 3))
        bloom = painted(f"bloom {colour}", colour)
        parts.append(foliage.flowers(rng, places, bloom, size=0.034, petals=5))
    return parts


def _ivy(rng: Rng, number: int, leaf: SurfaceMesh) -> SurfaceMesh:
    """Climbs the wall at the right of the window, thinning out upwards and sideways."""
    height = rng.beta(1.3, 1.8, number) * 2.7
    x = 0.42 + rng.normal(scale=0.13 + 0.10 * np.sin(height * 2.1) ** 2, size=number)
    x = x + 0.16 * np.sin(height * 1.7)
    positions = xyz(x, PAVEMENT_Y + height, WALL_Z + rng.uniform(0.02, 0.10, number))
    hang, sizes = xyz(rng.normal(scale=0.5, size=number), -1.0, 0.3), rng.uniform(0.6, 1.15, number)
    matrices = foliage.orient(rng, positions, hang, sizes, roll=0.5, face=(0, 0.5, 1))
    return scattered(leaf, matrices)
