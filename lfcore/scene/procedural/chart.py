"""The test chart: a blue plane before a background half green and half red, with text.

After figures 4.5 and 4.6 of the thesis: seen from the lens centre the right edge of the blue
plane falls on the edge between green and red, so that defocus mixes blue with green to cyan
and green with red to yellow, and the text shows where each plane is sharp.
"""

import numpy as np
from numpy.typing import ArrayLike

from lfcore.scene.procedural.basics import Parts, textured
from lfcore.scene.procedural.primitives import rectangle
from lfcore.scene.procedural.textures import blank_page, write
from lfcore.scene.surface_mesh import Surface, SurfaceMesh

RED, GREEN, BLUE = (214, 40, 40), (36, 168, 70), (40, 70, 214)
WHITE = (250, 250, 250)
FOREGROUND_M = 1.0
"""The distance of the blue plane from the lens."""
BACKGROUND_M = 2.0
"""The distance of the background from the lens."""
HALF_WIDTH_M = 1.1
"""Half the width of the background."""
# Share of the background's half width that the scene's own camera sees.
VISIBLE = 0.75


def build(seed: int) -> Parts:
    """6 triangles facing +z; the camera is at the origin and looks along -z.

    The foreground covers the lower left quarter of the background; no part is random.
    """
    near = HALF_WIDTH_M * FOREGROUND_M / BACKGROUND_M
    green = textured("green", _page(GREEN, "GREEN", BACKGROUND_M))
    red = textured("red", _page(RED, "RED", BACKGROUND_M))
    blue = textured("blue", _page(BLUE, "BLUE", FOREGROUND_M))
    half, depth = HALF_WIDTH_M, -BACKGROUND_M
    return [
        _page_of((-half, -half, depth), half, 2 * half, green),
        _page_of((0.0, -half, depth), half, 2 * half, red),
        _page_of((-near, -near, -FOREGROUND_M), near, near, blue),
    ]


def _page_of(origin: ArrayLike, width: float, height: float, surface: Surface) -> SurfaceMesh:
    """A rectangle tiled with square pages of the size of the camera's field, from the axis on."""
    part = rectangle(origin, (width, 0, 0), (0, height, 0), surface)
    return SurfaceMesh(part.triangles, surface, None, part.triangles[..., :2] / (VISIBLE * width))


def _page(colour: ArrayLike, word: str, distance_m: float) -> np.ndarray:
    """A 512 x 512 page of text in shrinking sizes, with resolution bars."""
    page, unit = blank_page(colour, (512, 512)), "metre" if distance_m == 1 else "metres"
    for text, y, height in (
        (word, 150, 92), (f"{distance_m:g} {unit}", 232, 46), ("light field", 290, 34),
        ("aperture focus lens", 336, 24), ("the quick brown fox jumps over", 370, 16),
    ):  # fmt: skip
        page = write(page, text, (256, y), height, WHITE)
    for line in range(6):
        width = 1 << (line // 2)
        start = 130 + 44 * line
        for bar in range(4):
            x = start + 2 * width * bar
            page[400:440, x : x + width] = WHITE
    return page
