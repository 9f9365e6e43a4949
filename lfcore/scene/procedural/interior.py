"""Parts of rooms: walls with windows and a door, and plain furniture beside the bedroom's.

Walls run along +x from the origin and face +z, furniture is about x = 0 with its back at z = 0 and
its front to +z, all on y = 0.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lfcore.scene.procedural.basics import Parts, Rng
from lfcore.scene.procedural.primitives import box, cushion, rectangle
from lfcore.scene.procedural.softgoods import pillow
from lfcore.scene.procedural.turned import cylinder, lathe, sphere
from lfcore.scene.surface_mesh import Surface, SurfaceMesh, transform_all
from lfcore.scene.transforms import rotate, translate

REVEAL_M = 0.14
"""The depth of a window's opening in its wall."""


PANE = Surface(
    "pane", (0.96, 0.98, 0.97), metallic=0.0, roughness=0.0, transmission=1.0, thin_walled=True
)
"""The glass of windows."""


class Window(NamedTuple):
    """An opening of a wall: its ends along the wall, its sill and its head, metres; whether it is
    glazed."""

    start: float
    end: float
    sill: float
    head: float
    glazed: bool = False


def wall(
    length: float, height: float, paint: Surface, white: Surface, windows: Sequence[Window],
    repeat: float,
) -> Parts:  # fmt: skip
    """A wall with a skirting board and windows, which have a frame, a bar and a sill."""
    parts, x = [], 0.0
    for window in (*windows, Window(length, length, 0, height)):
        parts.append(_panel(x, window.start, 0, height, paint, repeat))
        if window.end > window.start:
            parts.append(_panel(window.start, window.end, 0, window.sill, paint, repeat))
            parts.append(_panel(window.start, window.end, window.head, height, paint, repeat))
            parts += _window(window, paint, white)
        x = window.end
    return [*parts, box((length, 0.09, 0.016), white).at(length / 2, 0.045, 0.008)]


def _panel(
    x: float, end: float, low: float, high: float, paint: Surface, repeat: float
) -> SurfaceMesh:  # fmt: skip
    return rectangle((x, low, 0), (end - x, 0, 0), (0, high - low, 0), paint, repeat=repeat)


def _window(window: Window, paint: Surface, white: Surface) -> Parts:
    x0, x1, y0, y1, glazed = window
    wide, tall, x, y = x1 - x0, y1 - y0, (x0 + x1) / 2, (y0 + y1) / 2
    deep, z = (0, 0, REVEAL_M), -REVEAL_M
    parts = [
        rectangle((x0, y0, 0), (0, 0, -REVEAL_M), (0, tall, 0), paint),  # faces +x
        rectangle((x1, y0, z), deep, (0, tall, 0), paint),
        rectangle((x0, y0, 0), (wide, 0, 0), (0, 0, -REVEAL_M), paint),  # faces up
        rectangle((x0, y1, z), (wide, 0, 0), deep, paint),
        box((wide + 0.1, 0.03, 0.2), white).at(x, y0 - 0.015, 0.02),
    ]
    if glazed:
        parts.append(rectangle((x0, y0, z + 0.03), (wide, 0, 0), (0, tall, 0), PANE))
    uprights = [x0 + 0.025, x1 - 0.025] + ([x] if wide > 1 else [])
    parts += [box((0.05, tall, 0.05), white).at(at, y, z + 0.03) for at in uprights]
    for at in (y0 + 0.025, y1 - 0.025, y0 + 0.65 * tall):
        parts.append(box((wide, 0.05, 0.045), white).at(x, at, z + 0.03))
    return parts


def door(white: Surface, brass: Surface) -> Parts:
    """A closed door with its frame before the wall, 0.98 m wide."""
    parts = [box((0.84, 2.0, 0.03), white).at(0, 1.0, 0.015)]
    for y, tall in ((0.55, 0.75), (1.46, 0.8)):
        for x in (-0.19, 0.19):
            parts.append(box((0.27, tall, 0.012), white).at(x, y, 0.034))
    parts += [box((0.07, 2.07, 0.045), white).at(x, 1.035, 0.0225) for x in (-0.455, 0.455)]
    parts.append(box((0.98, 0.07, 0.045), white).at(0, 2.035, 0.0225))
    return [*parts, sphere(0.028, brass, segments=20, rings=12).at(0.36, 1.0, 0.08)]


def framed(picture: Surface, frame: Surface, width: float, tall: float, thick: float) -> Parts:
    """A picture in a frame, about x = 0, from y = 0."""
    parts = [rectangle((-width / 2, 0, 0.012), (width, 0, 0), (0, tall, 0), picture)]
    for side in (-1, 1):
        parts.append(box((thick, tall + thick, 0.03), frame).at(side * width / 2, tall / 2, 0.015))
        parts.append(box((width + thick, thick, 0.027), frame).at(0, tall * (side + 1) / 2, 0.0135))
    return parts


def table(width: float, height: float, depth: float, wood: Surface, rng: Rng) -> Parts:
    """A table with four legs, square or turned."""
    parts = [
        box((width, 0.035, depth), wood).at(0, height - 0.0175, depth / 2),
        box((width - 0.14, 0.07, depth - 0.14), wood).at(0, height - 0.07, depth / 2),
    ]
    turned = rng.random() < 0.5
    for x in (-width / 2 + 0.06, width / 2 - 0.06):
        for z in (0.06, depth - 0.06):
            tall = height - 0.035
            leg = (
                cylinder((x, 0, z), (x, tall, z), [0.018, 0.03], wood, segments=16) if turned
                else box((0.055, tall, 0.055), wood, grain=1).at(x, tall / 2, z)
            )  # fmt: skip
            parts.append(leg)
    return parts


def chair(wood: Surface, cloth: Surface) -> Parts:
    """A chair with a cushion and a slatted back, seat at 0.46 m."""
    parts = [
        box((0.42, 0.03, 0.42), wood).at(0, 0.43, 0.24),
        cushion((0.4, 0.05, 0.4), cloth, pieces=8, power=5.0).at(0, 0.465, 0.24),
    ]
    for x in (-0.19, 0.19):
        parts.append(box((0.035, 0.42, 0.035), wood, grain=1).at(x, 0.21, 0.43))
        parts.append(box((0.035, 0.9, 0.035), wood, grain=1).at(x, 0.45, 0.045))
    parts += [box((0.36, 0.06, 0.02), wood).at(0, y, 0.045) for y in (0.62, 0.74, 0.86)]
    return parts


def sofa(width: float, cloth: Surface, accent: Surface, wood: Surface, seed: int) -> Parts:
    """A sofa with loose pillows, 0.85 m deep."""
    seats, inner = round(width / 0.7), width - 0.4
    parts = [
        cushion((width - 0.06, 0.2, 0.8), cloth, pieces=8, power=7.0).at(0, 0.2, 0.43),
        cushion((width - 0.2, 0.55, 0.2), cloth, pieces=8, power=6.0).at(0, 0.56, 0.14),
    ]
    for side in (-1, 1):
        arm = cushion((0.2, 0.5, 0.8), cloth, pieces=8, power=5.0)
        parts.append(arm.at(side * (width / 2 - 0.1), 0.37, 0.43))
        lean = rotate("x", 62), rotate("y", -12 * side)
        loose = pillow((0.44, 0.17, 0.42), accent, seed=seed + side, pieces=12)
        parts.append(loose.transformed(*lean, translate(side * (inner / 2 - 0.24), 0.66, 0.38)))
        parts += [
            cylinder((side * (width / 2 - 0.1), 0, z), (side * (width / 2 - 0.1), 0.12, z), 0.022,
                     wood, segments=10) for z in (0.1, 0.75)
        ]  # fmt: skip
    for k in range(seats):
        x = inner * ((k + 0.5) / seats - 0.5)
        seat = cushion((inner / seats, 0.16, 0.62), cloth, pieces=8, power=5.0)
        parts.append(seat.at(x, 0.37, 0.53))
    return parts


def cabinet(
    width: float, height: float, depth: float, wood: Surface, brass: Surface, *, doors: int,
    drawers: int = 0,
) -> Parts:  # fmt: skip
    """A cabinet on a plinth: doors side by side, below ``drawers`` rows of drawers."""
    parts = [
        box((width - 0.06, 0.06, depth - 0.06), wood).at(0, 0.03, depth / 2 - 0.02),
        box((width, height - 0.06, depth - 0.02), wood).at(0, height / 2 + 0.03, depth / 2 - 0.01),
    ]
    top, wide = height - 0.02, width / doors
    for row in range(drawers + 1):
        tall = 0.2 if row < drawers else top - 0.08
        for k in range(doors):
            x, y = (k + 0.5) * wide - width / 2, top - tall / 2
            front = (wide - 0.012, tall - 0.012, 0.02)
            parts.append(box(front, wood).at(x, y, depth))
            knob = x if row < drawers else x + (0.5 - k % 2) * (wide - 0.12)
            parts.append(sphere(0.014, brass, segments=14, rings=8).at(knob, y, depth + 0.024))
        top -= tall
    return parts


def floor_lamp(shade: Surface, metal: Surface) -> Parts:
    """A lamp on a pole, 1.6 m tall."""
    return [
        lathe("0 0, 0.14 0, 0.14 0.02, 0.015 0.035, 0.012 1.4, 0 1.4", metal, segments=32),
        lathe("0.2 1.3, 0.14 1.6", shade, segments=40),
        lathe("0.139 1.6, 0.199 1.3", shade, segments=40),
    ]


def dining_set(rng: Rng, wood: Surface, cloth: Surface) -> tuple[Parts, float, float]:
    """A table with two or four chairs; also the table's width and depth."""
    width, depth = float(rng.uniform(0.9, 1.5)), float(rng.uniform(0.75, 0.9))
    parts = [part.at(0, 0, -depth / 2) for part in table(width, 0.75, depth, wood, rng)]
    seats = np.linspace(-0.25, 0.25, 2) * width if width > 1.2 else [0.0]
    for side in (0, 180):
        for x in seats:
            away = depth / 2 + float(rng.uniform(0.2, 0.45))
            turn = rotate("y", 180 + side + float(rng.uniform(-8, 8)))
            place = translate(x, 0, away if side == 0 else -away)
            parts += transform_all(chair(wood, cloth), translate(0, 0, -0.24), turn, place)
    return parts, width, depth
