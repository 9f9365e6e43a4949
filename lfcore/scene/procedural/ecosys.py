"""A hillside of instanced plants behind two trees: more than a million triangles.

After the assignment's ecosys scene: with a lens wide enough, focused on the hillside, the trees
dissolve and the picture sees through them.
"""

import numpy as np
from numpy.typing import ArrayLike

from lfcore.errors import SceneError
from lfcore.scene.procedural import textures
from lfcore.scene.procedural.basics import Look, Parts, Point, Rng, textured
from lfcore.scene.procedural.foliage import blade, diamond, orient, rosette, shrub, tuft
from lfcore.scene.procedural.primitives import mesh_grid, scattered
from lfcore.scene.procedural.turned import curve, tube
from lfcore.scene.surface_mesh import Surface, SurfaceMesh, join, xyz

# Species: plants at density 1, nearest and farthest distance, smallest and largest size.
SPECIES = {
    "grass": (4200, 4.0, 70.0, 0.7, 1.6),
    "fern": (1500, 5.0, 60.0, 0.8, 1.8),
    "bush": (1400, 9.0, 110.0, 0.7, 1.9),
    "heather": (1100, 8.0, 110.0, 0.6, 1.3),
    "young tree": (330, 34.0, 118.0, 0.8, 1.8),
}
# Foot x, distance, height: the two trees that stand before the hillside.
TREES = ((-3.4, 12.0, 7.0), (4.6, 19.0, 9.0))


def build(seed: int, *, plants: float = 1.0, tree_leaves: int = 9000, terrain: int = 200) -> Parts:
    """The scene seen from (0, 1.8, 0) along -z; 1.2 million triangles if ``plants`` is 1."""
    for key, value, least, most in (
        ("plants", plants, 0, 50),
        ("tree_leaves", tree_leaves, 1, 10_000_000),
        ("terrain", terrain, 2, 4096),
    ):
        if not least <= value <= most:
            raise SceneError(f"must be from {least} to {most}, not {value:g}", key=key)
    rng = np.random.default_rng(seed)
    surfaces = _surfaces(seed)
    parts = [_ground(terrain, surfaces["ground"])]
    for name, plant in _species(rng, surfaces).items():
        number, near, far, small, large = SPECIES[name]
        places = _places(rng, round(number * plants), near, far, small, large)
        parts += [scattered(part, places) for part in plant if len(places)]
    for x, distance, height in TREES:
        foot = np.array([x, ground_height(x, -distance) - 0.1, -distance])
        parts += tree(rng, surfaces["bark"], surfaces["leaf"], foot, height, tree_leaves)
    return parts


def ground_height(x: np.ndarray | float, z: np.ndarray | float) -> np.ndarray:
    """Metres above the plain: rolling meadow, rising to a hill from 25 m away."""
    rise = np.clip((-np.asarray(z) - 25.0) / 85.0, 0.0, 1.0)
    hill = 26.0 * rise * rise * (3.0 - 2.0 * rise)
    waves = 0.25 * np.sin(0.35 * x + 0.2 * z) + 0.18 * np.cos(0.51 * z - 0.23 * x)
    ridges = 1.6 * rise * np.sin(0.11 * x + 1.0) * np.cos(0.09 * z)
    return hill + waves * np.clip(-np.asarray(z) / 12.0, 0.0, 1.0) + ridges


def _surfaces(seed: int) -> Look:
    def leafy(name: str, number: int, dark: ArrayLike, light: ArrayLike) -> Surface:
        return textured(name, textures.leaf(seed + number, dark, light))

    meadow = textures.speckle(seed, ((74, 70, 38), (110, 112, 54), (150, 140, 84)))
    bark = textures.bark(seed + 1, (52, 42, 34), (120, 100, 80))
    return {
        "ground": textured("ground", meadow),
        "bark": textured("bark", bark),
        "leaf": leafy("tree leaf", 2, (48, 84, 26), (128, 164, 62)),
        "grass": leafy("grass", 3, (96, 112, 44), (176, 176, 92)),
        "fern": leafy("fern", 4, (40, 92, 40), (96, 156, 70)),
        "bush": leafy("bush", 5, (36, 70, 36), (92, 124, 64)),
        "heather": leafy("heather", 6, (120, 54, 96), (196, 120, 168)),
        "young leaf": leafy("young leaf", 7, (70, 98, 30), (170, 176, 70)),
    }


def _species(rng: Rng, surfaces: Look) -> dict[str, Parts]:
    """One plant of each kind, foot at the origin, as the parts it is made of."""
    frond = blade(0.7, 0.16, surfaces["fern"], pieces=3)
    small = diamond(0.16, 0.09, surfaces["bush"])
    bell = diamond(0.1, 0.05, surfaces["heather"])
    young = diamond(0.34, 0.2, surfaces["young leaf"])
    stem = tube([(0, 0, 0), (0, 1.6, 0)], [0.06, 0.03], surfaces["bark"], segments=5, caps=False)
    return {
        "grass": [tuft(rng, 22, surfaces["grass"], height=0.5, radius=0.16)],
        "fern": [rosette(rng, 12, frond)],
        "bush": [shrub(rng, 120, small, (0.5, 0.42, 0.5), centre=(0, 0.4, 0))],
        "heather": [shrub(rng, 90, bell, (0.4, 0.22, 0.4), centre=(0, 0.18, 0))],
        "young tree": [stem, shrub(rng, 160, young, (0.75, 1.1, 0.75), centre=(0, 2.1, 0))],
    }


def _places(
    rng: Rng, number: int, near: float, far: float, small: float, large: float
) -> np.ndarray:
    """(number, 4, 4): upright plants within the view's wedge, evenly over the ground."""
    # Even over the area of a wedge: the square of the distance is uniform.
    distance = np.sqrt(rng.uniform(near * near, far * far, number))
    x = distance * rng.uniform(-0.85, 0.85, number)
    positions = xyz(x, ground_height(x, -distance) - 0.02, -distance)
    return orient(rng, positions, (0.0, 1.0, 0.0), rng.uniform(small, large, number))


def _ground(cells: int, surface: Surface) -> SurfaceMesh:
    x, z = np.meshgrid(np.linspace(-110, 110, cells + 1), np.linspace(3, -125, cells + 1))
    points = xyz(x, ground_height(x, z), z)
    return mesh_grid(points, surface, np.stack([x, -z], -1) * 0.15)


def tree(
    rng: Rng, bark: Surface, leaf: Surface, foot: np.ndarray, height: float, leaves: int
) -> Parts:
    """A broad-leaved tree: a trunk, three orders of branches, leaves around the twigs."""
    lean = rng.normal(scale=0.04, size=2) * height
    top = foot + (lean[0], 0.55 * height, lean[1])
    trunk = curve([foot, (foot + top) / 2 + rng.normal(scale=0.04, size=3) * height, top], 8)
    radius = 0.035 * height
    limbs = [tube(trunk, np.linspace(radius, 0.5 * radius, 8), bark, segments=9, caps=False)]
    ends: list[Point] = []

    def branch(base: Point, direction: Point, length: float, radius: float, order: int) -> None:
        """Add a branch and those that grow from it; the last order's ends carry leaves."""
        end = base + direction * length
        bow = (base + end) / 2 + (0, 0.08 * length, 0) + rng.normal(scale=0.05, size=3) * length
        path = curve([base, bow, end], 5)
        limbs.append(tube(path, np.linspace(radius, 0.4 * radius, 5), bark, segments=5, caps=False))
        if order == 1:
            ends.extend([path[2], path[3], end])
            return
        for share in (0.45, 0.7, 0.85, 1.0):
            turned = direction + 0.9 * _outward(rng, 0.5)
            turned /= np.linalg.norm(turned)
            start = path[min(int(share * 4), 4)]
            branch(start, turned, 0.55 * length, 0.5 * radius, order - 1)

    for start in np.linspace(0.45, 1.0, 9):
        base = trunk[min(int(start * 7), 7)]
        branch(base, _outward(rng, 0.75), 0.36 * height, 0.4 * radius, 3)
    tips = np.array(ends)
    chosen = tips[rng.integers(0, len(tips), leaves)]
    positions = chosen + rng.normal(scale=0.035 * height, size=(leaves, 3))
    aim = rng.normal(size=(leaves, 3)) + (0, -0.4, 0)
    sizes = rng.uniform(0.7, 1.3, leaves)
    crown = scattered(diamond(0.15, 0.1, leaf), orient(rng, positions, aim, sizes))
    return [join(limbs), crown]


def _outward(rng: Rng, lift: float) -> np.ndarray:
    turn = rng.uniform(0, 2 * np.pi)
    direction = np.array([np.cos(turn), lift * rng.uniform(0.4, 1.4), np.sin(turn)])
    return direction / np.linalg.norm(direction)
