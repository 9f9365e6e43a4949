"""The test chart: a blue plane before a background half green and half red, with text.

After figures 4.5 and 4.6 of the thesis: seen from the lens centre the right edge of the blue
plane falls on the edge between green and red, so that defocus mixes blue with green to cyan
and green with red to yellow, and the text shows where each plane is sharp.
"""

import numpy as np
from numpy.typing import ArrayLike

from lfcore.errors import SceneError
from lfcore.scene.procedural.basics import Parts, textured
from lfcore.scene.procedural.lettering import blank_page, write
from lfcore.scene.procedural.primitives import rectangle
from lfcore.scene.surface_mesh import Surface, SurfaceMesh

RED, GREEN, BLUE = (214, 40, 40), (36, 168, 70), (40, 70, 214)
WHITE = (250, 250, 250)
# Share of the background's half width that the scene's own camera sees.
VISIBLE = 0.75


def build(
    seed: int, *, foreground_m: float = 1.0, background_m: float = 2.0, half_width_m: float = 1.1
) -> Parts:
    """6 triangles facing +z; the camera stands at the origin and looks along -z.

    Parameters
    ----------
    foreground_m, background_m : distances of the two planes from the lens.
    half_width_m : of the background; the foreground covers the lower left quarter of it as
        seen from the lens.  ``seed`` changes nothing: the chart has no random part.
    """
    if not 0 < foreground_m < background_m:
        raise SceneError(
            f"{foreground_m:g} m is not between the lens and the background at {background_m:g} m",
            key="foreground_m",
            remedy="Choose 0 < foreground_m < background_m",
        )
    near = half_width_m * foreground_m / background_m
    green = textured("green", _page(GREEN, "GREEN", background_m))
    red = textured("red", _page(RED, "RED", background_m))
    blue = textured("blue", _page(BLUE, "BLUE", foreground_m))
    half, depth = half_width_m, -background_m
    return [
        _page_of((-half, -half, depth), half, 2 * half, green),
        _page_of((0.0, -half, depth), half, 2 * half, red),
        _page_of((-near, -near, -foreground_m), near, near, blue),
    ]


def _page_of(origin: ArrayLike, width: float, height: float, surface: Surface) -> SurfaceMesh:
    """A rectangle tiled with square pages as large as the camera sees of it, from the axis on."""
    part = rectangle(origin, (width, 0, 0), (0, height, 0), surface)
    return SurfaceMesh(part.triangles, surface, None, part.triangles[..., :2] / (VISIBLE * width))


def _page(colour: ArrayLike, word: str, distance_m: float) -> np.ndarray:
    """A 512 x 512 page of text in shrinking sizes, with resolution bars."""
    page = blank_page(colour, (512, 512))
    page = write(page, word, (256, 150), 92, WHITE)
    unit = "metre" if distance_m == 1 else "metres"
    page = write(page, f"{distance_m:g} {unit}", (256, 232), 46, WHITE)
    page = write(page, "light field", (256, 290), 34, WHITE)
    page = write(page, "aperture focus lens", (256, 336), 24, WHITE)
    page = write(page, "the quick brown fox jumps over", (256, 370), 16, WHITE)
    for line in range(6):
        width = 1 << (line // 2)
        start = 130 + 44 * line
        for bar in range(4):
            x = start + 2 * width * bar
            page[400:440, x : x + width] = WHITE
    return page
