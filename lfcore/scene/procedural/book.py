"""A book with a readable cover on a floor, in the pose of the assignment's book.

A box with a cover, a spine and page edges; its rotation is that of the pbrt book scene, so the
cover leans back and the title, the authors and the edges lie at different depths.
"""

import numpy as np

from lfcore.scene.procedural import textures
from lfcore.scene.procedural.basics import Parts, textured
from lfcore.scene.procedural.primitives import quad, rectangle
from lfcore.scene.procedural.textures import blank_page, write
from lfcore.scene.transforms import affine, chain, rotate, translate

# Rotation of the book in pbrt-book/book.pbrt: angle in degrees and axis.
POSE = (77.3425, (0.403388, -0.754838, -0.517202))
CENTRE = (0.0, 2.2, 0.0)
SIZE_M = np.array([4.0, 5.0, 1.2])
TITLE, AUTHORS = "LIGHT FIELDS", "A. Lumen   B. Parallax   C. Aperture"
NAVY, CREAM, GOLD, RED = (24, 38, 78), (244, 236, 214), (222, 178, 84), (178, 48, 42)
RED_ON_DARK = (240, 120, 96)


def build(seed: int) -> Parts:
    """16 triangles: cover, back, spine, three page edges, floor and wall; the cover faces +z."""
    parts = _box(SIZE_M / 2, seed)
    # The assignment's mesh lies on its back: cover up (+y), top of the page at -x.
    lie = affine([[0, -1, 0], [0, 0, 1], [-1, 0, 0]])
    pose = chain(lie, rotate(POSE[1], POSE[0]), translate(*CENTRE))
    parts = [part.transformed(pose) for part in parts]
    lowest = min(part.triangles[..., 1].min() for part in parts)
    return [*parts, *_room(seed, lowest - 0.02)]


def _box(half: np.ndarray, seed: int) -> Parts:
    """The book facing +z, upright, its spine on the left."""
    x, y, z = half
    cover = textured("cover", _cover(seed), 0.25, 60.0)
    back = textured("back cover", blank_page(NAVY, (8, 8)), 0.25, 60.0)
    page = blank_page(NAVY, (1280, 320))
    page[60:72, 30:290] = page[1208:1220, 30:290] = GOLD
    page = write(page, TITLE, (160, 640), 110, GOLD, turn=-1)
    spine = textured("spine", page, 0.25, 60.0)
    shade = np.random.default_rng(seed + 3).uniform(0.78, 1.0, (1, 256, 1))
    paper = np.broadcast_to(np.array(CREAM) * shade, (256, 256, 3))
    pages = textured("pages", textures.finish(paper))
    return [
        quad([(-x, -y, z), (x, -y, z), (x, y, z), (-x, y, z)], cover),
        quad([(x, -y, -z), (-x, -y, -z), (-x, y, -z), (x, y, -z)], back),
        quad([(-x, -y, -z), (-x, -y, z), (-x, y, z), (-x, y, -z)], spine),
        quad([(x, -y, z), (x, -y, -z), (x, y, -z), (x, y, z)], pages),
        quad([(-x, y, z), (x, y, z), (x, y, -z), (-x, y, -z)], pages),
        quad([(-x, -y, -z), (x, -y, -z), (x, -y, z), (-x, -y, z)], pages),
    ]


def _room(seed: int, floor_y: float) -> Parts:
    boards = textures.planks(seed + 1, (96, 66, 42), (150, 108, 70))
    floor = textured("floor", boards)
    wall = textured("wall", textures.plaster(seed + 2, (196, 204, 210)))
    return [
        rectangle((-14, floor_y, 8), (28, 0, 0), (0, 0, -18), floor, repeat=0.25),
        rectangle((-14, floor_y, -10), (28, 0, 0), (0, 16, 0), wall, repeat=0.2),
    ]


def _cover(seed: int) -> np.ndarray:
    """(1280, 1024, 3): frame, title, a picture of ripples and the authors' line."""
    page = blank_page(NAVY, (1280, 1024))
    page[40:1240, 40:984] = CREAM
    page[52:1228, 52:972] = NAVY
    y, x = np.mgrid[:600, :800] / 600
    wave = np.zeros((600, 800))
    for centre_x, centre_y in np.random.default_rng(seed).uniform(0, 1.3, (5, 2)):
        wave += np.sin(38.0 * np.hypot(x - centre_x, y - centre_y))
    ripples = textures.ramp(wave / 8 + 0.5, NAVY, RED, GOLD, CREAM)
    page[360:960, 112:912] = textures.finish(ripples)
    for line, word in enumerate(TITLE.split()):
        page = write(page, word, (512, 140 + line * 150.0), 150.0, GOLD)
    page = write(page, "from rays to pictures", (512, 1010), 44, CREAM)
    return write(page, AUTHORS, (512, 1120), 1700.0 / len(AUTHORS), RED_ON_DARK)
