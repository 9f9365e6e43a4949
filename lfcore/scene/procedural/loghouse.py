"""A log cabin with a shingled roof, a stone chimney and a porch; its front faces +z."""

import numpy as np

from lfcore.scene.procedural import textures
from lfcore.scene.procedural.basics import Look, Parts, Point, Rng, Size, painted, textured
from lfcore.scene.procedural.primitives import box, quad, rectangle
from lfcore.scene.procedural.turned import cylinder, log, tube
from lfcore.scene.surface_mesh import Surface, SurfaceMesh, join

WIDTH, DEPTH, RADIUS, COURSES = 4.0, 3.0, 0.105, 11
EAVES = 0.30 + (COURSES - 0.5) * 2 * RADIUS * 0.96
RIDGE = EAVES + 1.45


def surfaces(seed: int) -> Look:
    timber = textures.wood(seed + 31, (112, 68, 36), (182, 126, 74), size=(128, 512), rings=5)
    grain = textures.end_grain(seed + 32, (132, 88, 48), (214, 172, 116), size=(128, 128))
    boards = textures.planks(seed + 33, (104, 70, 42), (156, 112, 70), rows=8, stagger=False)
    shingle = textures.wood(seed + 34, (86, 70, 60), (138, 116, 98), size=(256, 256), rings=9)
    tones, size = ((112, 106, 100), (150, 142, 130), (132, 120, 106)), (256, 256)
    stone = textures.cobbles(seed + 35, tones, (84, 78, 70), cells=6, size=size)
    green = (72, 96, 60), (104, 132, 82)
    door = textures.planks(seed + 36, *green, rows=5, size=size, stagger=False)
    return {
        "timber": textured("log", np.rot90(timber).copy()),
        "grain": textured("log end", grain),
        "boards": textured("boards", boards, tone=0.95),
        "shingle": textured("shingle", np.rot90(shingle).copy()),
        "stone": textured("chimney stone", stone, tone=0.95),
        "door": textured("cabin door", np.rot90(door).copy()),
        "trim": painted("trim", "#e6dcc6"),
        "glow": Surface("lit pane", (0.12, 0.08, 0.05), emission=(0.72, 0.40, 0.11)),
        "iron": painted("iron", "#2c2c2e", 0.3, 40.0),
    }


def loghouse(seed: int) -> Parts:
    """About 4,700 triangles, standing on y = 0 with its middle at the origin."""
    rng = np.random.default_rng(seed + 30)
    look = surfaces(seed)
    parts = _walls(look) + _gables(look) + _roof(rng, look) + _chimney(look)
    parts += _door(look) + _porch(rng, look)
    for x in (-1.25, 1.3):
        parts += _window(look, np.array([x, 1.45, DEPTH / 2 + RADIUS]), np.array([1.0, 0, 0]))
    for z in (-0.7, 0.7):
        parts += _window(look, np.array([-WIDTH / 2 - RADIUS, 1.45, z]), np.array([0, 0, 1.0]))
        parts += _window(look, np.array([WIDTH / 2 + RADIUS, 1.45, z]), np.array([0, 0, -1.0]))
    return parts


def _walls(look: Look) -> Parts:
    parts = [box((WIDTH + 0.3, 0.34, DEPTH + 0.3), look["stone"], repeat=1.2).at(0, 0.08, 0)]
    step, out, far = 2 * RADIUS * 0.96, WIDTH / 2 + 0.24, DEPTH / 2 + 0.24
    logs = []
    for course in range(COURSES):
        y = 0.30 + (course + 0.5) * step
        logs += [((-out, y, z), (out, y, z)) for z in (-DEPTH / 2, DEPTH / 2)]
        y += step / 2
        if course < COURSES - 1:
            logs += [((x, y, -far), (x, y, far)) for x in (-WIDTH / 2, WIDTH / 2)]
    for ends in logs:
        parts += log(*ends, RADIUS, look["timber"], look["grain"])
    return parts


def _gables(look: Look) -> Parts:
    """Boarded triangles over the side walls; the ridge runs along x."""
    parts = []
    for x in (-WIDTH / 2, WIDTH / 2):
        low, out = EAVES - 0.1, DEPTH / 2 + 0.1
        corners = np.array([[[x, low, -out], [x, low, out], [x, RIDGE - 0.06, 0]]])
        parts.append(SurfaceMesh(corners, look["boards"], None, corners[..., [1, 2]] * 0.5))
        barge = 0.42 * np.sign(x)
        for side in (-1, 1):
            foot = np.array([x + barge, EAVES - 0.30, side * (DEPTH / 2 + 0.52)])
            top = np.array([x + barge, RIDGE + 0.02, 0])
            parts.append(quad([foot - (0, 0.16, 0), top - (0, 0.16, 0), top, foot], look["trim"]))
    return parts


def _roof(rng: Rng, look: Look) -> Parts:
    """Two slopes of boards, the front one shingled, and the ridge log."""
    half, parts = WIDTH / 2 + 0.45, []
    for side in (-1.0, 1.0):
        foot = np.array([0, EAVES - 0.30, side * (DEPTH / 2 + 0.55)])
        slope, across = np.array([0, RIDGE, 0]) - foot, np.array([2 * half, 0, 0])
        surface = look["boards"] if side > 0 else look["shingle"]
        corner = foot - across / 2
        parts.append(rectangle(corner - (0, 0.06, 0), across, slope, surface, repeat=0.5))
        if side > 0:
            parts.append(_shingles(rng, corner, across, slope, (13, 17), look["shingle"]))
    ridge = [(-half, RIDGE + 0.03, 0), (half, RIDGE + 0.03, 0)]
    return [*parts, tube(ridge, 0.06, look["timber"], segments=8)]


def _shingles(
    rng: Rng, corner: Point, across: Point, slope: Point, number: Size, surface: Surface
) -> SurfaceMesh:
    """Overlapping rows of single shingles, 4 triangles each, every one a little askew.

    ``corner`` is the lower left of the roof, ``across`` its eaves and ``slope`` its rise;
    ``number`` (rows, columns).
    """
    rows, columns = number
    out = np.cross(across, slope)
    out = out / np.linalg.norm(out) * np.sign(out[1])
    parts = []
    for row in range(rows):
        offset = 0.5 * (row % 2)
        for column in range(columns + row % 2):
            left = max((column - offset) / columns, 0.0)
            right = min((column - offset + 0.96) / columns, 1.0)
            low = corner + slope * ((row - 0.10 + rng.uniform(-0.06, 0.06)) / rows)
            high = corner + slope * min((row + 1.15) / rows, 1.0)
            lift = out * (0.055 + rng.uniform(0, 0.015))
            a, b = low + left * across + lift, low + right * across + lift
            c, d = high + right * across, high + left * across
            uv = rng.random() + np.array([[0, 0], [0.25, 0], [0.25, 0.5], [0, 0.5]])
            parts.append(quad([a, b, c, d], surface, uv))
            parts.append(quad([a - lift * 0.7, b - lift * 0.7, b, a], surface, uv * 0.3))
    return join(parts)


def _chimney(look: Look) -> Parts:
    x, z = 1.05, -0.55
    return [
        box((0.62, 2.6, 0.55), look["stone"], repeat=1.4).at(x, EAVES + 0.75, z),
        box((0.74, 0.12, 0.67), look["stone"], repeat=1.4).at(x, EAVES + 2.08, z),
        cylinder((x, EAVES + 2.1, z), (x, EAVES + 2.4, z), 0.13, look["iron"], segments=10),
    ]


def _window(look: Look, centre: np.ndarray, across: np.ndarray) -> Parts:
    """A lit window of four panes in a board frame, ``across`` pointing right from outside."""
    up, width, tall = np.array([0, 1.0, 0]), 0.74, 0.84
    out = np.cross(across, up)

    def bar(x: float, y: float, half_x: float, half_y: float, depth: float, name: str) -> None:
        size = np.abs(across) * 2 * half_x + up * 2 * half_y + np.abs(out) * depth
        place = centre + x * across + y * up + out * depth / 2
        parts.append(box(size, look[name]).at(*place))

    corner = centre - across * width / 2 - up * tall / 2 + out * 0.02
    parts = [rectangle(corner, across * width, up * tall, look["glow"])]
    for x in (-width / 2 - 0.04, width / 2 + 0.04):
        bar(x, 0, 0.05, tall / 2 + 0.09, 0.07, "trim")
    for y in (-tall / 2 - 0.04, tall / 2 + 0.04):
        bar(0, y, width / 2 + 0.02, 0.05, 0.08, "trim")
    bar(0, 0, 0.02, tall / 2, 0.05, "trim")
    bar(0, 0, width / 2, 0.02, 0.05, "trim")
    bar(0, -tall / 2 - 0.12, width / 2 + 0.14, 0.025, 0.14, "boards")
    return parts


def _door(look: Look) -> Parts:
    z, trim = DEPTH / 2 + RADIUS, look["trim"]
    low, high = ((0.33, y, z + 0.05) for y in (1.2, 1.36))
    return [
        box((0.9, 1.85, 0.06), look["door"], repeat=1.0).at(0, 0.33 + 0.925, z),
        *(box((0.12, 1.95, 0.10), trim).at(x, 0.33 + 0.975, z) for x in (-0.51, 0.51)),
        box((1.14, 0.13, 0.11), trim).at(0, 0.33 + 1.94, z),
        rectangle((-0.2, 1.62, z + 0.035), (0.4, 0, 0), (0, 0.36, 0), look["glow"]),
        cylinder(low, high, 0.018, look["iron"], segments=6),
    ]


def _porch(rng: Rng, look: Look) -> Parts:
    boards, timber, front = look["boards"], look["timber"], DEPTH / 2 + 1.25
    planks = [(0, 0.30, DEPTH / 2 + 0.18 + index * 0.125) for index in range(9)]
    parts = [box((3.1, 0.05, 0.115), boards, repeat=0.5).at(*place) for place in planks]
    steps = (0, 0.19, front + 0.14 + 0.26 * 0), (0, 0.07, front + 0.14 + 0.26 * 1)
    parts += [box((1.0, 0.07, 0.28), boards).at(*place) for place in steps]
    eave, before = EAVES - 0.34, front - 0.06
    for x in (-1.5, -0.62, 0.62, 1.5):
        parts += log((x, 0.0, before), (x, eave - 0.1, before), 0.06, timber, look["grain"])
    beam = (-1.62, eave - 0.12, before), (1.62, eave - 0.12, before)
    parts += log(*beam, 0.075, timber, look["grain"])
    low, across = np.array([-1.8, eave - 0.12, front + 0.28]), np.array([3.6, 0, 0])
    slope = np.array([0, 0.52, -1.35])
    parts.append(rectangle(low - (0, 0.02, 0), across, slope, boards, repeat=0.5))
    parts.append(_shingles(rng, low, across, slope, (5, 14), look["shingle"]))
    parts.append(rectangle(low - (0, 0.05, 0), across, (0, 0.05, 0), look["trim"]))
    for left, right in ((-1.5, -0.62), (0.62, 1.5)):
        rails = [((left, y, before), (right, y, before)) for y in (0.48, 0.92)]
        parts += [tube(rail, 0.03, timber, segments=6) for rail in rails]
        for x in np.linspace(left, right, 6)[1:-1]:
            bar = (x, 0.48, before), (x, 0.92, before)
            parts.append(cylinder(*bar, 0.018, timber, segments=5, caps=False))
    return parts
