"""Toys: letter blocks, a beach ball, a stacking tower, a wooden train."""

import numpy as np
from PIL.ImageColor import getrgb

from lfcore.scene.procedural import textures
from lfcore.scene.procedural.basics import Parts, painted, textured
from lfcore.scene.procedural.primitives import box, cushion
from lfcore.scene.procedural.turned import cylinder, lathe, ring, sphere, tube
from lfcore.scene.surface_mesh import Surface, SurfaceMesh, transform_all
from lfcore.scene.transforms import rotate, translate

PAINTS = ("#d8483c", "#e9b33a", "#3f8fb5", "#5aa05a", "#8a5fa8", "#e58a4c")
BLOCKS = (
    ("A", -0.10, 0.0, 0.02, 14), ("B", 0.01, 0.0, -0.02, -9), ("C", -0.05, 0.086, 0.0, 31),
    ("L", 0.16, 0.0, 0.10, 48), ("F", -0.22, 0.0, 0.12, -30),
)  # fmt: skip
"""The letters of blocks, their places and turns in degrees."""
WHEEL = "0 -0.008, 0.034 -0.008, 0.037 0, 0.034 0.008, 0.014 0.008, 0.012 0.014, 0 0.014"


def toy_paint(index: int) -> Surface:
    colour = PAINTS[index % len(PAINTS)]
    return painted(f"toy {colour}", colour, 0.18, 40.0)


def letter_block(letter: str, index: int, seed: int) -> SurfaceMesh:
    """A wooden cube with rounded edges and a letter framed on each side; 768 triangles."""
    wood = textures.wood(seed + index, (206, 168, 116), (232, 204, 158), size=(128, 128), rings=4)
    ink = getrgb(PAINTS[index % len(PAINTS)])
    face = wood.copy()
    face[10:118, 10:118] = ink
    face[17:111, 17:111] = wood[17:111, 17:111]
    face = textures.write(face, letter, (64, 62), 84, ink)
    surface = textured(f"block {letter}", face, 0.04, 25.0)
    side = 0.085
    return cushion((side,) * 3, surface, pieces=8, power=14.0, repeat=1 / side)


def ball(seed: int) -> SurfaceMesh:
    """Six coloured gores and two white caps."""
    texture = np.zeros((128, 256, 3), np.uint8)
    for gore in range(6):
        texture[:, gore * 256 // 6 : (gore + 1) * 256 // 6] = getrgb(PAINTS[gore])
        texture[:, gore * 256 // 6 : gore * 256 // 6 + 3] = (244, 238, 226)
    texture[:12] = texture[-12:] = (244, 238, 226)
    whole = sphere(0.13, textured("beach ball", texture, 0.3, 60.0), segments=60, rings=40)
    return whole.transformed(rotate("z", 35), rotate("y", 20 + seed % 7), translate(0, 0.13, 0))


def ring_tower() -> Parts:
    """Rings of falling size on a peg; 0.3 m tall."""
    foot = painted("toy wood", "#d8b27c", 0.08, 30.0)
    parts = [
        lathe("0 0, 0.1 0, 0.1 0.015, 0.09 0.025, 0 0.025", foot, segments=48),
        cylinder((0, 0.02, 0), (0, 0.26, 0), 0.012, foot, segments=16),
    ]
    y = 0.025
    for index, radius in enumerate((0.078, 0.070, 0.062, 0.054, 0.046)):
        thick = 0.026 - 0.0015 * index
        y += thick
        path = ring(radius - thick * 0.6, 60)[:, [0, 2, 1]] + (0, y, 0)
        parts.append(tube(path, thick, toy_paint(index), segments=16, closed=True))
        y += thick * 0.72
    return [*parts, sphere(0.03, toy_paint(5), segments=30, rings=20).at(0, y + 0.02, 0)]


def train() -> Parts:
    """An engine and a wagon, along +x; 0.5 m long."""
    wood = painted("toy wood", "#d8b27c", 0.08, 30.0)
    chimney = "0.014 0, 0.014 0.05, 0.026 0.075, 0.02 0.075, 0 0.06"
    parts = [
        box((0.24, 0.03, 0.10), wood).at(0.0, 0.055, 0),
        cylinder((-0.02, 0.115, 0), (0.125, 0.115, 0), 0.046, toy_paint(2), segments=36),
        cushion((0.09, 0.13, 0.10), toy_paint(0), pieces=10, power=10.0).at(-0.07, 0.135, 0),
        box((0.11, 0.014, 0.12), toy_paint(1)).at(-0.07, 0.207, 0),
        lathe(chimney, toy_paint(1), segments=28).at(0.085, 0.155, 0),
        sphere(0.02, toy_paint(5), segments=24, rings=16).at(0.03, 0.165, 0),
        box((0.20, 0.03, 0.10), wood).at(-0.28, 0.055, 0),
        *(box((0.19, 0.07, 0.012), toy_paint(3)).at(-0.28, 0.105, z) for z in (0.044, -0.044)),
        *(box((0.012, 0.07, 0.10), toy_paint(3)).at(x, 0.105, 0) for x in (-0.19, -0.37)),
        cylinder((-0.18, 0.05, 0), (-0.12, 0.05, 0), 0.006, wood, segments=8),
    ]
    for x in (-0.075, 0.075, -0.22, -0.34):
        for z in (-0.06, 0.06):
            wheel = lathe(WHEEL, toy_paint(0 if x > -0.2 else 2), segments=32)
            turn = rotate("x", 90 if z > 0 else -90)
            parts.append(wheel.transformed(turn, translate(x, 0.037, z)))
    for index, x in enumerate((-0.32, -0.26, -0.22)):
        place = (x, 0.115, 0.008 * (index - 1))
        parts.append(sphere(0.032, toy_paint(index + 3), segments=24, rings=16).at(*place))
    return parts


def toy_corner(seed: int) -> Parts:
    """Blocks, ball, rings and train laid out around the origin, some 0.9 m across."""
    parts = [
        letter_block(letter, i, seed).transformed(rotate("y", turn), translate(x, y + 0.0425, z))
        for i, (letter, x, y, z, turn) in enumerate(BLOCKS)
    ]
    parts += transform_all(ring_tower(), translate(0.38, 0, -0.12))
    parts.append(ball(seed).at(-0.36, 0, -0.22))
    return parts + transform_all(train(), rotate("y", -24), translate(0.20, 0, 0.34))
