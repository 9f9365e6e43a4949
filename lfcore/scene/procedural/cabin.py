"""The cabin scene: a log cabin among spruces, a split-rail fence and a log pile before it."""

import itertools
from dataclasses import replace
from typing import Any

import numpy as np

from lfcore.scene.procedural import foliage, textures
from lfcore.scene.procedural.basics import Look, Parts, Rng, filled_to, painted, textured
from lfcore.scene.procedural.loghouse import loghouse
from lfcore.scene.procedural.primitives import box, disc, mesh_grid, rectangle, scattered
from lfcore.scene.procedural.turned import cylinder, lathe, log, sphere, tube
from lfcore.scene.surface_mesh import SurfaceMesh, merge, transform_all, xyz
from lfcore.scene.transforms import chain, rotate, scale, translate

SPRUCES = (
    (-4.3, -4.6), (4.6, -6.2), (-2.9, -8.5), (2.9, -9.5), (6.3, -9.0), (-6.4, -8.0),
    (0.4, -11.5), (-8.5, -13.0), (8.6, -13.5), (-4.5, -14.0), (4.4, -15.0), (-1.6, -16.0),
    (2.0, -19.0), (-6.8, -18.5), (7.2, -19.0), (11.5, -18.0), (-11.5, -17.0),
)  # fmt: skip


def build(seed: int, *, triangles: int = 15000) -> Parts:
    """Exactly ``triangles`` of them; grass takes up what the rest leaves."""
    rng = np.random.default_rng(seed)
    look = _surfaces(seed)
    parts = _land(look) + _sky(seed)
    place = chain(rotate("y", -24), translate(0.3, height(0.3, -4.6), -4.6))
    parts += transform_all(loghouse(seed), place)
    parts += _trees(rng, look) + _fence(rng, look)
    parts += transform_all(_log_pile(rng, look), translate(-0.85, height(-0.85, 2.5), 2.5))
    parts += transform_all(_chopping_block(look), translate(0.45, height(0.45, 2.3), 2.3))
    parts += _mushrooms(look) + _stones(look)
    tuft = foliage.tuft(rng, 7, look["grass blade"], height=0.17, radius=0.06)
    return merge(filled_to(triangles, parts, tuft, lambda n: _meadow(rng, n, tuft)))


def height(x: Any, z: Any) -> Any:
    """Height of the ground in metres; level under the cabin, rising behind it."""
    swell = 0.10 * np.sin(0.9 * x + 0.4) * np.cos(0.7 * z) + 0.05 * np.sin(2.1 * x - 1.3 * z)
    behind = np.clip((-z - 7.0) / 16.0, 0, 1) ** 1.5 * 3.0
    near_house = np.exp(-(((x - 0.3) / 3.2) ** 4) - ((z + 4.6) / 3.0) ** 4)
    return swell * (1 - near_house) + behind


def path_middle(z: np.ndarray | float) -> np.ndarray:
    """x of the path that winds from the lower right to the steps of the porch."""
    run = (5.0 - z) / 6.7
    return 1.25 + 0.3 * np.sin(3.4 * run) - 2.0 * run**2


def _surfaces(seed: int) -> Look:
    bark = textures.bark(seed + 1, (52, 38, 28), (128, 98, 72))
    rings = textures.end_grain(seed + 2, (140, 96, 52), (222, 182, 124))
    grey = np.rot90(textures.wood(seed + 3, (104, 92, 78), (164, 150, 130), size=(128, 256)))
    greens = (62, 84, 30), (92, 116, 42), (120, 138, 58)
    grass = textures.speckle(seed + 4, greens, cells=(20, 20), octaves=4)
    browns = (112, 90, 62), (150, 124, 90), (176, 152, 116)
    earth = textures.speckle(seed + 5, browns, cells=(16, 16), octaves=4, size=(256, 256))
    needles = textures.bark(seed + 6, (22, 50, 30), (70, 112, 54), size=(128, 128))
    stone = textures.speckle(seed + 7, ((96, 98, 96), (140, 140, 132)), size=(128, 128))
    return {
        "bark": textured("bark", bark),
        "rings": textured("end grain", rings),
        "grey wood": textured("weathered wood", grey),
        "grass": textured("grass", grass, tone=0.9),
        "earth": textured("path", earth, tone=0.95),
        "needles": textured("needles", needles),
        "stone": textured("stone", stone, tone=0.95),
        "grass blade": painted("grass blade", "#7f9a3c"),
        "iron": painted("axe iron", "#8b9096", 0.5, 50.0),
        "red": painted("mushroom cap", "#c2271b", 0.25, 40.0),
        "white": painted("mushroom", "#efe8d8"),
    }


def _land(look: Look) -> Parts:
    z = 5.5 - 30.0 * np.linspace(0, 1, 19)[:, None] ** 1.6
    x = np.linspace(-1, 1, 17) * (4.5 + 0.55 * (5.5 - z))
    grass = xyz(x, height(x, z), z)
    # A hand above the chords of the grass grid.
    run, across = np.linspace(0, 1, 15)[:, None], np.linspace(-0.40, 0.40, 4)
    z = 5.0 - 6.7 * run
    x = path_middle(z) + across * (1 + 0.15 * np.sin(17 * run + 1))
    way = xyz(x, height(x, z) + 0.035 - 0.9 * (across / 0.40) ** 4 * 0.035, z)
    return [
        mesh_grid(grass, look["grass"], grass[..., [0, 2]] * 0.35, crease_deg=180),
        mesh_grid(way, look["earth"], way[..., [0, 2]] * 0.6, crease_deg=180),
    ]


def _sky(seed: int) -> Parts:
    """A backdrop 55 m away: evening sky, clouds, two ranges of hills with woods."""
    v = np.mgrid[:512, :512][0] / 512.0
    sky = textures.ramp(np.clip(v / 0.72, 0, 1), (92, 144, 196), (158, 194, 220), (246, 224, 190))
    cloud = textures.noise(seed + 20, cells=(7, 3), octaves=5)
    cover = np.clip((cloud - 0.55) * 2.6, 0, 1) * np.clip(1.1 - v / 0.75, 0, 1)
    picture = sky + (np.array([250, 240, 228]) - sky) * 0.85 * cover[..., None]
    crest = textures.noise(seed + 21, cells=(1, 4), octaves=4)[0]
    hills = (0.70, 0.16, (126, 148, 164), 0.0), (0.78, 0.10, (84, 112, 104), 0.012)
    for base, rise, tone, rough in hills:
        ridge = base - rise * np.roll(crest, int(90 * base))
        teeth = rough * np.abs(np.sin(np.arange(512) * 0.9) + np.sin(np.arange(512) * 0.37))
        inside = v > (ridge - teeth)[None, :]
        haze = np.clip((v - ridge[None]) / 0.3, 0, 1)[..., None]
        colour = np.asarray(tone) * (1 - haze) + np.array([150, 164, 150]) * haze
        picture = np.where(inside[..., None], colour, picture)
    surface = textured("backdrop", textures.finish(picture))
    return [rectangle((-30, -2, -46), (60, 0, 0), (0, 34, 0), surface)]


def _trees(rng: Rng, look: Look) -> Parts:
    """Spruces behind and beside the cabin."""
    parts = []
    for x, z in SPRUCES:
        tall = rng.uniform(4.6, 7.0)
        tree = foliage.conifer(rng, look["needles"], look["bark"], tall)
        place = translate(x + rng.uniform(-0.3, 0.3), height(x, z) - 0.05, z)
        parts += transform_all(tree, rotate("y", rng.uniform(0, 360)), place)
    return parts


def _fence(rng: Rng, look: Look) -> Parts:
    """Posts and two rails on either side of the path, at about 5 m."""
    parts = []
    for run in (np.arange(-5.35, 0.2, 1.1), np.arange(1.4, 5.2, 1.1)):
        feet = np.stack([run, height(run, 0.2), 0.2 + 0.12 * np.sin(run * 1.7)], -1)
        for foot in feet:
            top = foot + (rng.uniform(-0.03, 0.03), 0.92, rng.uniform(-0.03, 0.03))
            parts += log(foot - (0, 0.1, 0), top, 0.065, look["grey wood"], look["rings"])
        for low, (a, b) in itertools.product((0.38, 0.72), list(itertools.pairwise(feet))):
            lift = rng.uniform(-0.03, 0.03, 2)
            start, end = a + (-0.12, low + lift[0], 0.05), b + (0.12, low + lift[1], 0.05)
            rail = [start, (start + end) / 2 + (0, -0.025, 0), end]
            parts.append(tube(rail, 0.042, look["grey wood"], segments=6, repeat=2))
    return parts


def _log_pile(rng: Rng, look: Look) -> Parts:
    """Three courses of sawn logs, ends to the camera."""
    parts = []
    for course, number in enumerate((5, 4, 3)):
        for index in range(number):
            radius = rng.uniform(0.082, 0.10)
            x = (index - (number - 1) / 2) * 0.2 + rng.uniform(-0.008, 0.008)
            y = 0.09 + course * 0.168
            ends = (x, y, 0.30 + rng.uniform(-0.04, 0.04)), (x, y, -0.35)
            wood = log(*ends, radius, look["bark"], look["rings"], segments=14)
            parts += transform_all(wood, rotate("y", 16))
    return parts


def _chopping_block(look: Look) -> Parts:
    """A stump with an axe in it and split wood around."""
    stump = lathe("0.26 -0.05, 0.215 0.05, 0.2 0.4", look["bark"], segments=18, repeat=1.6)
    parts = [stump, disc((0, 0.40, 0), (0, 1, 0), 0.20, look["rings"], segments=18)]
    path = [(0.0, 0, 0), (0.02, 0.22, 0), (0.0, 0.44, 0), (0.015, 0.62, 0)]
    handle = tube(path, [0.016, 0.014, 0.015, 0.019], look["grey wood"], segments=7)
    head = box((0.17, 0.075, 0.04), look["iron"]).at(0.03, 0.0, 0)
    # Taper the blade towards -x, where it bites.
    edge = head.triangles[..., 0:1] < 0
    bitten = np.where(edge, head.triangles * (1.0, 1.35, 0.08), head.triangles)
    axe = [handle, replace(head, triangles=bitten).at(0, 0.01, 0)]
    parts += transform_all(axe, rotate("z", 52), rotate("y", 150), translate(0.03, 0.47, 0.02))
    for x, z, turn in ((-0.38, 0.10, 20.0), (-0.30, 0.30, 75.0), (0.34, 0.24, -35.0)):
        parts += transform_all(_split(look), rotate("y", turn), translate(x, 0.02, z))
    return parts


def _split(look: Look) -> Parts:
    """A quarter of a log, 12 triangles or so."""
    angle = np.linspace(0, np.pi / 2, 5) + np.pi / 4
    rim = xyz(0.0, np.sin(angle) - 0.45, np.cos(angle)) * 0.11
    core = np.array([[0.0, -0.05, 0.0]])
    outline = np.concatenate([rim, core])
    points = np.stack([outline - (0.17, 0, 0), outline + (0.17, 0, 0)])
    uv = np.linspace(0, 1, 7), (0.0, 1.0)
    side = mesh_grid(points, look["bark"], uv, close_columns=True, crease_deg=35)
    ends = []
    for row in points:
        fan = np.stack([np.broadcast_to(row[-1], (4, 3)), row[:4], row[1:5]], 1)
        ends.append(SurfaceMesh(fan, look["rings"], None, fan[..., [2, 1]] * 4 + 0.5))
    return [side, *ends]


def _mushrooms(look: Look) -> Parts:
    parts = []
    for x, z, size in ((-0.12, 2.78, 1.0), (0.0, 2.86, 0.7), (-0.2, 2.9, 0.55)):
        ends = (0, 0, 0), (0.008, 0.13, 0)
        stem = cylinder(*ends, [0.024, 0.017], look["white"], segments=9, caps=False)
        profile = "0 0.11, 0.085 0.105, 0.09 0.12, 0.075 0.155, 0.04 0.18, 0 0.188"
        cap = lathe(profile, look["red"], segments=14)
        dots = []
        for index in range(11):
            turn, out = index * 2.4, 0.078 * np.sqrt((index + 0.5) / 11)
            y = 0.190 - 3.6 * out**2 - 60 * out**4
            spot, radii = (np.cos(turn) * out, y, np.sin(turn) * out), (0.010, 0.005, 0.010)
            dots.append(sphere(radii, look["white"], segments=5, rings=2).at(*spot))
        place = scale(size), translate(x, height(x, z), z)
        parts += transform_all([stem, cap, *dots], *place)
    return parts


def _stones(look: Look) -> Parts:
    parts = []
    for x, z, size in (
        (-1.75, 2.6, 0.17), (1.55, 2.3, 0.14), (2.05, 3.0, 0.20), (-0.2, 2.7, 0.09),
        (0.15, 0.6, 0.13),
    ):  # fmt: skip
        stone = sphere((size, size * 0.62, size * 0.85), look["stone"], segments=9, rings=6)
        assert stone.uvs is not None
        shape = 1 + 0.16 * np.sin(stone.triangles * 23 / (size * 8) + 9 * x)
        stone = replace(stone, triangles=stone.triangles * shape, uvs=stone.uvs * 2)
        place = translate(x, height(x, z) + 0.02, z)
        parts.append(stone.transformed(rotate("y", 70 * x), place))
    return parts


def _meadow(rng: Rng, number: int, tuft: SurfaceMesh) -> SurfaceMesh:
    """Tufts over the grass, denser near the camera, none on the path or in the house."""
    spots = np.zeros((0, 2))
    while len(spots) < number:
        z = 4.6 - 8.5 * rng.random(4 * number) ** 1.4
        x = rng.uniform(-1, 1, 4 * number) * (1.0 + 0.42 * (6.5 - z))
        free = (np.abs(x - path_middle(z)) > 0.46) | (z < -1.8)
        free &= (np.abs(x - 0.3) > 3.2) | (z > -1.5)
        spots = np.concatenate([spots, np.stack([x, z], -1)[free]])
    x, z = spots[:number].T
    matrices = np.tile(np.eye(4), (number, 1, 1))
    size, turn = rng.uniform(0.7, 1.5, number), rng.uniform(0, 2 * np.pi, number)
    matrices[:, 0, 0] = matrices[:, 2, 2] = np.cos(turn) * size
    matrices[:, 0, 2], matrices[:, 2, 0] = np.sin(turn) * size, -np.sin(turn) * size
    matrices[:, 1, 1] = size
    matrices[:, :3, 3] = xyz(x, height(x, z) - 0.01, z)
    return scattered(tuft, matrices)
