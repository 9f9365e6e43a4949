"""What the bedroom is made of: its cloths, paints and things, by name."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lfcore.scene.procedural import furniture, textures
from lfcore.scene.procedural.basics import Look, codes, painted, textured
from lfcore.scene.procedural.bicycle import wicker
from lfcore.scene.procedural.pictures import earth_map, rug_pattern
from lfcore.scene.surface_mesh import Surface


def surfaces(seed: int) -> Look:
    """Woods, cloths and things."""

    def cloth(name: str, colour: ArrayLike, number: int, **more: Any) -> Surface:
        return textured(name, textures.weave(seed + number, colour, **more))

    white, blue, red = (236, 230, 216), (62, 96, 124), (196, 120, 96)
    tones = (white, blue, white, blue, white, red)
    stripes = textures.stripes(seed + 4, tones, (4, 1, 2, 1, 4, 2))
    curtain = textures.stripes(seed + 7, ((204, 194, 176), (178, 158, 130)), (3, 1), depth=0.08)
    return furniture.bedroom_wood(seed + 100) | {
        "linen": cloth("linen", (238, 232, 220), 1),
        "blush": cloth("blush cotton", (214, 152, 138), 2),
        "mustard": cloth("mustard cotton", (212, 158, 52), 3),
        "stripe": textured("striped cotton", stripes),
        "quilt": textured("quilt", patchwork(seed + 5)),
        "knit": textured("knitted throw", knitting(seed + 6, (196, 108, 78))),
        "velvet": painted("velvet", "#3f6570", 0.05, 8.0),
        "velvet 2": painted("ochre velvet", "#b8863b", 0.05, 8.0),
        "curtain": textured("curtain", curtain),
        "rug": textured("rug", rug_pattern(seed + 8)),
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
        "leaf": textured(
            "plant leaf",
            textures.leaf(seed + 10, (26, 70, 40), (92, 150, 74)),
            (0.14, 0.15, 0.13),
            35.0,
        ),
        "tulip": painted("tulip", "#e0526a", 0.06, 20.0),
        "stalk": painted("stalk", "#5b6b34"),
        "basket": textured("basket", wicker(seed + 11)),
        "earth": textured("globe", earth_map(seed + 12), 0.25, 60.0),
        "white": painted("white paint", "#efebe2", 0.06, 30.0),
    }


def patchwork(seed: int) -> np.ndarray:
    """(512, 512, 3) uint8: 4 x 4 squares of different cloths, stitched."""
    rng = np.random.default_rng(seed)
    tones = ("#e2d6be", "#6c8c96", "#ca8a76", "#e8c478", "#4a6880", "#96a88c")
    picture = np.zeros((512, 512, 3), np.uint8)
    v, u = np.mgrid[:128, :128] / 128.0
    for row in range(4):
        for column in range(4):
            base = np.array(codes(tones[(row * 2 + column * 5 + (row * column) % 3) % 6]))
            other = np.array(codes(tones[(row * 3 + column + 2) % 6]))
            kind = int(rng.integers(4))
            if kind == 0:
                mask = np.hypot((u * 4) % 1 - 0.5, (v * 4) % 1 - 0.5) < 0.22
            elif kind == 1:
                mask = (u * 6 % 1) < 0.4
            elif kind == 2:
                mask = np.abs(u - 0.5) + np.abs(v - 0.5) < 0.34
            else:
                mask = ((np.floor(u * 4) + np.floor(v * 4)) % 2) > 0
            cloth = textures.weave(
                seed + row * 4 + column, (255, 255, 255), size=(128, 128), threads=32
            )
            patch = np.where(mask[..., None], 0.55 * base + 0.45 * other, base) * (cloth / 255.0)
            seam = np.minimum.reduce([u, 1 - u, v, 1 - v])
            patch *= (0.80 + 0.20 * np.clip(seam / 0.05, 0, 1))[..., None]
            stitch = (np.abs(seam - 0.075) < 0.008) & (((u + v) * 16 % 1) < 0.6)
            patch[stitch] = (246, 240, 228)
            picture[row * 128 : row * 128 + 128, column * 128 : column * 128 + 128] = (
                textures.finish(patch)
            )
    return picture


def knitting(seed: int, colour: ArrayLike) -> np.ndarray:
    """(256, 256, 3) uint8: stocking stitch with a cable."""
    v, u = np.mgrid[:256, :256] / 256.0
    x = u * 20 % 1
    stitch = np.sin(np.pi * ((v * 20 + np.abs(x - 0.5)) % 1)) * np.sin(np.pi * x) ** 0.6
    cable = np.exp(-(((u % 0.5 - 0.25 - 0.05 * np.sin(v * 2 * np.pi * 4)) / 0.04) ** 2))
    fuzz = textures.noise(seed, cells=(40, 40), octaves=2, size=(256, 256))
    shade = 0.62 + 0.30 * stitch + 0.12 * cable + 0.10 * fuzz
    return textures.finish(np.asarray(colour) * shade[..., None])
