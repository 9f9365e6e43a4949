"""A city bicycle, along +x with its wheels on the ground and its frame in the plane z = 0."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from lfcore.scene.procedural import textures
from lfcore.scene.procedural.basics import Look, Parts, painted, textured
from lfcore.scene.procedural.primitives import box, cushion, mesh_grid
from lfcore.scene.procedural.turned import curve, cylinder, lathe, outline, ring, sphere, tube
from lfcore.scene.surface_mesh import SurfaceMesh, transform_all, xyz
from lfcore.scene.transforms import rotate, translate

WHEEL = 0.335
REAR, FRONT = np.array([-0.53, WHEEL + 0.02, 0.0]), np.array([0.56, WHEEL + 0.02, 0.0])
BRACKET, SEAT = np.array([-0.08, 0.29, 0.0]), np.array([-0.24, 0.80, 0.0])
HEAD_LOW, HEAD_HIGH = np.array([0.385, 0.71, 0.0]), np.array([0.335, 0.90, 0.0])


def paints(seed: int) -> Look:
    """The surfaces of the bicycle by name."""
    leather = textures.speckle(seed + 1, ((84, 44, 22), (128, 72, 38)), size=(128, 128))
    return {
        "paint": painted("paint", "#1d7a80", 0.35, 90.0),
        "cream": painted("cream", "#e9dfc4", 0.25, 60.0),
        "rubber": painted("rubber", "#2b2a2c", 0.06, 12.0),
        "wall": painted("tyre wall", "#b99b6b", 0.05, 12.0),
        "chrome": painted("chrome", "#a8adb4", 0.55, 60.0),
        "steel": painted("steel", "#7d8188", 0.55, 60.0),
        "leather": textured("leather", leather, (0.12, 0.1, 0.08), 25.0),
        "wicker": textured("wicker", wicker(seed + 2)),
        "glass": painted("lamp glass", "#f4ecc8", 0.5, 80.0),
    }


def wicker(seed: int) -> np.ndarray:
    """Basket weave: horizontal willow over and under upright rods."""
    v, u = np.mgrid[:256, :256] / 256.0
    rows, rods = 12, 8
    over = (np.floor(v * rows) + np.floor(u * rods)) % 2
    bulge = np.sin(np.pi * (v * rows % 1)) * (0.65 + 0.35 * np.sin(np.pi * (u * rods % 1)))
    rod = np.sin(np.pi * (u * rods % 1)) ** 0.5 * 0.75
    shade = np.where(over > 0, bulge, np.maximum(0.55 * bulge, 0.8 * rod * (bulge < 0.45)))
    grain = textures.noise(seed, cells=(32, 8), octaves=3, size=(256, 256))
    tone = np.clip(0.8 * shade + 0.25 * grain, 0, 1)
    return textures.finish(textures.ramp(tone, (58, 34, 14), (158, 108, 54), (214, 168, 100)))


def bicycle(seed: int) -> Parts:
    """About 5,000 triangles."""
    look = paints(seed)
    parts = [*_wheel(REAR, look), *_wheel(FRONT, look)]
    parts += _frame(look) + _mudguards(look) + _drive(look) + _saddle(look) + _handlebar(look)
    parts += _rack(look) + _basket(look) + _lamp(look)
    return parts


def _wheel(hub: np.ndarray, look: Look) -> Parts:
    rim = tube(ring(WHEEL - 0.045, 36), 0.014, look["chrome"], segments=4, closed=True)
    tread = tube(ring(WHEEL - 0.012, 40), 0.024, look["rubber"], segments=6, closed=True)
    spokes = []
    for index in range(28):
        angle = index * 2 * np.pi / 28
        side = 0.035 if index % 2 else -0.035
        lean = angle + (0.55 if index % 4 < 2 else -0.55)
        foot = (0.028 * np.cos(lean), 0.028 * np.sin(lean), side)
        reach = WHEEL - 0.055
        tip = (reach * np.cos(angle), reach * np.sin(angle), 0)
        spokes.append(cylinder(foot, tip, 0.0022, look["chrome"], segments=3, caps=False))
    half = outline("0 -0.07, 0.012 -0.07, 0.012 -0.045, 0.03 -0.04, 0.03 -0.03, 0.016 -0.022")
    profile = np.concatenate([half, half[::-1] * (1, -1)])
    axle = lathe(profile, look["steel"], segments=8).transformed(rotate("x", 90))
    return transform_all([rim, tread, *spokes, axle], translate(*hub))


def _frame(look: Look) -> Parts:
    paint = look["paint"]

    def bar(points: ArrayLike, radius: ArrayLike, segments: int = 8) -> SurfaceMesh:
        return tube(points, radius, paint, segments=segments)

    swan = curve([HEAD_HIGH - (0, 0.05, 0), (0.12, 0.58, 0), (-0.10, 0.50, 0), (-0.17, 0.56, 0)], 8)
    axle = np.array([0, 0, 0.045])
    parts = [
        bar(swan, 0.016),
        bar(curve([HEAD_LOW, (0.18, 0.44, 0), BRACKET], 6), 0.019),
        bar([BRACKET, SEAT], 0.017),
        bar([HEAD_LOW - (0, 0.02, 0), HEAD_HIGH], 0.021, 10),
        bar([BRACKET - axle, BRACKET + axle], 0.024, 10),
    ]
    for side in (-1, 1):
        z = np.array([0, 0, 0.055 * side])
        parts.append(bar([BRACKET + 0.5 * z, REAR + z], 0.010, 6))
        parts.append(bar([SEAT - (0, 0.05, 0) + 0.3 * z, REAR + z], 0.009, 6))
        knees = (0.43, 0.55, z[2]), (0.50, 0.40, z[2])
        fork = [HEAD_LOW + (0, -0.01, 0) + 0.5 * z, *knees, FRONT + z]
        parts.append(bar(curve(fork, 6), [0.016, 0.014, 0.013, 0.012, 0.011, 0.009]))
    return parts


def _mudguards(look: Look) -> Parts:
    parts = []
    for hub, start, stop in ((REAR, 5, 190), (FRONT, 15, 165)):
        angle = np.radians(np.linspace(start, stop, 19))
        across = np.linspace(-1, 1, 5)
        radius = WHEEL + 0.045 - 0.018 * across**2
        a, r = np.meshgrid(angle, radius, indexing="ij")
        points = xyz(np.cos(a) * r, np.sin(a) * r, across * 0.034) + hub
        parts.append(mesh_grid(points, look["cream"], crease_deg=80))
        for side in (-1, 1):
            for turn in np.radians([stop - 25, 90]):
                reach = WHEEL + 0.03
                tip = hub + (np.cos(turn) * reach, np.sin(turn) * reach, 0.032 * side)
                stay = [hub + (0, 0, 0.06 * side), tip]
                parts.append(tube(stay, 0.003, look["chrome"], segments=3, caps=False))
    return parts


def _drive(look: Look) -> Parts:
    z, steel = 0.055, look["steel"]
    wheel = tube(ring(0.085, 28), 0.006, steel, segments=4, closed=True)
    arms = [cylinder((0, 0, 0), tip, 0.006, steel, segments=4) for tip in ring(0.085, 5)]
    parts = transform_all([wheel, *arms], translate(*(BRACKET + (0, 0, z))))
    front, back = np.radians(np.linspace(100, -95, 9)), np.radians(np.linspace(265, 95, 7))
    links = [BRACKET + (0.09 * np.cos(angle), 0.09 * np.sin(angle), z) for angle in front]
    links += [REAR + (0.045 * np.cos(angle), 0.045 * np.sin(angle), z) for angle in back]
    parts.append(tube(links, 0.006, look["rubber"], segments=4, closed=True))
    cog = lathe("0 -0.006, 0.042 -0.006, 0.042 0.006, 0 0.006", steel, segments=14)
    parts.append(cog.transformed(rotate("x", 90), translate(*(REAR + (0, 0, z)))))
    # The guard covers the upper run of the chain.
    top = [BRACKET + (0.10, 0.03, z), BRACKET + (0.03, 0.115, z), REAR + (0.12, 0.085, z)]
    path = curve(top, 9)
    rows = (0, -0.035, 0.012), (0, 0.0, 0.016), (0, 0.012, -0.014)
    sheet = np.stack([path + row for row in rows], 1)
    parts.append(mesh_grid(sheet, look["paint"], crease_deg=80))
    for side, turn in ((1, -50.0), (-1, 130.0)):
        angle = np.radians(turn)
        end = BRACKET + np.array([0.17 * np.cos(angle), 0.17 * np.sin(angle), 0.085 * side])
        start = BRACKET + (0, 0, 0.07 * side)
        parts.append(cylinder(start, end, [0.012, 0.009], look["chrome"], segments=6))
        parts.append(box((0.09, 0.018, 0.075), look["rubber"]).at(*(end + (0, 0, 0.05 * side))))
    stand = [(-0.16, 0.27, -0.03), (-0.20, 0.12, -0.14), (-0.22, 0.01, -0.20)]
    return [*parts, tube(curve(stand, 4), 0.009, steel, segments=6)]


def _saddle(look: Look) -> Parts:
    foot, chrome = (SEAT - (0, 0.02, 0), SEAT + (-0.045, 0.13, 0)), look["chrome"]
    body = cushion((0.27, 0.07, 0.2), look["leather"], pieces=5, power=3.0, repeat=4.0)
    # Narrow the nose: width falls towards +x.
    x = np.clip(body.triangles[..., 0:1] / 0.135, -1, 1)
    width = np.interp(x, [-1, -0.2, 0.35, 1], [0.95, 1.0, 0.42, 0.30])
    pinch = np.concatenate([np.ones_like(x), np.ones_like(x), width], -1)
    shaped = replace(body, triangles=body.triangles * pinch)
    springs = []
    for side in (-0.05, 0.05):
        angle = np.linspace(0, 6 * np.pi, 19)
        rise = 0.90 + angle / angle[-1] * 0.055
        coil = xyz(-0.345 + 0.016 * np.cos(angle), rise, side + 0.016 * np.sin(angle))
        springs.append(tube(coil, 0.004, chrome, segments=3, caps=False))
    return [
        cylinder(*foot, 0.012, chrome, segments=8),
        shaped.transformed(rotate("z", 4), translate(-0.275, 0.975, 0)),
        *springs,
    ]


def _handlebar(look: Look) -> Parts:
    chrome = look["chrome"]
    stem = [HEAD_HIGH, HEAD_HIGH + (-0.02, 0.11, 0), HEAD_HIGH + (0.03, 0.16, 0)]
    parts = [tube(curve(stem, 5), 0.013, chrome, segments=8)]
    x, y, _ = stem[-1]
    half = [(x, y, 0), (x + 0.03, y + 0.03, 0.14), (x - 0.06, y + 0.06, 0.27),
            (x - 0.24, y + 0.03, 0.30)]  # fmt: skip
    for side in (-1, 1):
        path = curve(half, 10) * (1, 1, side)
        parts.append(tube(path, 0.011, chrome, segments=7))
        start, end = path[-1] - (0.015, 0, 0), path[-1] + (0.11, 0.015, -0.012 * side)
        parts.append(cylinder(start, end, 0.017, look["leather"], segments=8))
        lever = [path[6] + (0.02, -0.02, 0), path[8] + (0.02, -0.045, 0.01 * side)]
        parts.append(tube(lever, 0.005, chrome, segments=4))
    bell = lathe("0.03 0, 0.029 0.012, 0.02 0.024, 0.0 0.029", chrome, segments=12)
    return [*parts, bell.at(x - 0.04, y + 0.065, 0.20)]


def _rack(look: Look) -> Parts:
    y = 0.775
    wires: list[list] = [[(-0.82, y, z), (-0.34, y, z)] for z in (-0.06, 0.0, 0.06)]
    wires += [[(x, y, -0.062), (x, y, 0.062)] for x in (-0.82, -0.58, -0.34)]
    wires += [[(-0.66, y, 0.06 * side), REAR + (0, 0, 0.065 * side)] for side in (-1, 1)]
    red, place = painted("tail lamp", "#b3161b", 0.4, 60.0), (-0.868, 0.575, 0)
    return [
        *(tube(np.array(wire), 0.005, look["chrome"], segments=5) for wire in wires),
        sphere((0.02, 0.025, 0.025), red, segments=8, rings=6).at(*place),
    ]


def _basket(look: Look) -> Parts:
    """A tapered wicker basket before the handlebar, open on top, with a rolled rim."""
    angle, wicker = np.arange(20) * 2 * np.pi / 20, look["wicker"]
    square = np.stack([np.cos(angle), np.sin(angle)], -1)
    square /= (np.abs(square) ** 5).sum(1, keepdims=True) ** 0.2
    rows = [
        xyz(square[:, 0] * 0.125 * size, height, square[:, 1] * 0.17 * size)
        for size, height in outline("0 0, 0.8 0, 0.84 0.02, 1 0.19, 0.94 0.19, 0.8 0.03")
    ]
    uv = np.linspace(0, 6, 21), (0.0, 0.3, 0.4, 1.4, 1.45, 2.4)
    shell = mesh_grid(np.array(rows), wicker, uv, close_columns=True, crease_deg=50)
    edge = rows[3] * (0.985, 1, 0.985)
    rim = tube(edge, 0.009, wicker, segments=5, closed=True, repeat=20)
    return transform_all([shell, rim], translate(0.52, 0.80, 0))


def _lamp(look: Look) -> Parts:
    profile = "0 -0.07, 0.025 -0.06, 0.042 -0.02, 0.046 0.0, 0.04 0.004"
    shell = lathe(profile, look["chrome"], segments=14)
    glass = lathe("0.04 0.0, 0.03 0.012, 0.0 0.016", look["glass"], segments=14)
    return transform_all([shell, glass], rotate("z", -90), translate(0.50, 0.74, 0))
