"""The shell of a room: floor, ceiling, walls with windows and a door, and the ground outside.

A room is drawn in world space, y up, with the floor on y = 0 and the middle at x = z = 0.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lfcore.datasets.moving import Thing
from lfcore.scene.procedural import interior, pictures, softgoods, textures
from lfcore.scene.procedural.basics import Look, Parts
from lfcore.scene.procedural.bedroom import surfaces
from lfcore.scene.procedural.interior import Window
from lfcore.scene.procedural.primitives import rectangle
from lfcore.scene.surface_mesh import Surface, SurfaceMesh, transform_all, triple
from lfcore.scene.transforms import rotate, translate

if TYPE_CHECKING:
    from lfcore.datasets.draws import Draw

TRIES = 30
"""The positions that are tried before a thing is left out."""
LOOKS = 4
"""The sets of textures of furniture; their colours vary per room."""
GAP_M = 0.02
"""The least distance between things, metres."""
TINTED = ("blush", "mustard", "stripe", "quilt", "knit", "velvet", "velvet 2", "curtain", "glaze",
          "rug", "tulip", "books")  # fmt: skip
"""The surfaces whose colours vary."""


class Box(NamedTuple):
    """A rectangle on the floor: (4, 4) pose, least and greatest x and z in it, and its height."""

    pose: np.ndarray
    low: np.ndarray
    high: np.ndarray
    height: float

    def corners(self) -> np.ndarray:
        """Return the four corners, (4, 2) x and z."""
        (x0, z0), (x1, z1) = self.low, self.high
        points = np.array([(x0, 0, z0, 1), (x1, 0, z0, 1), (x1, 0, z1, 1), (x0, 0, z1, 1)])
        return (points @ self.pose.T)[:, [0, 2]]

    def depths(self, eye: np.ndarray, towards: np.ndarray) -> np.ndarray:
        """Return the depths (R,) at which rays from ``eye`` to ``towards`` (R, 3) enter the box
        that stands on the rectangle; infinity for a miss."""
        origin = self.pose[:3, :3].T @ (eye - self.pose[:3, 3])
        directions = towards @ self.pose[:3, :3]
        ends = np.array(
            [(self.low[0], 0.0, self.low[1]), (self.high[0], self.height, self.high[1])]
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            crossed = np.sort((ends[:, None] - origin) / directions, axis=0)
        enters, leaves = np.nanmax(crossed[0], axis=1), np.nanmin(crossed[1], axis=1)
        return np.where((leaves > enters) & (leaves > 0), np.maximum(enters, 0.0), np.inf)

    def meets(self, other: Box, gap: float = GAP_M) -> bool:
        """Return whether two rectangles are nearer than ``gap``, by separating axes."""
        a, b = self.corners(), other.corners()
        for pose in (self.pose, other.pose):
            for axis in (pose[[0, 2], 0], pose[[0, 2], 2]):
                p, q = a @ axis, b @ axis
                if p.min() > q.max() + gap or q.min() > p.max() + gap:
                    return False
        return True


@lru_cache(maxsize=LOOKS)
def _look(number: int) -> Look:
    return surfaces(100 + number)


class Shell:
    """The draws of a room's shell; ``draw`` has the description, and draws materials and shapes."""

    def __init__(self, draw: Draw):
        self.draw, self.rng = draw, draw.rng
        self.width, self.depth, self.height = (
            self.uniform(*ends) for ends in ((3.2, 5.2), (3.6, 6.0), (2.4, 2.9))
        )
        self.look = self._tinted(_look(int(self.rng.integers(LOOKS))))
        self.parts: Parts = []
        self.owners: list[int] = []
        """The object of each part, from 1; 0: the room itself."""
        self.boxes: list[Box] = []
        self.small_boxes: list[Box] = []
        """Around things on furniture."""
        self.tops: list[tuple[np.ndarray, tuple[float, ...]]] = []
        self.names: list[str] = []
        self.things: list[Thing] = []
        self.openings: dict[int, list[tuple[float, float, float]]] = {side: [] for side in range(4)}
        self.windows: list[tuple[int, Window]] = []
        self.lamps: list[np.ndarray] = []

    def put(self, parts: Parts, pose: np.ndarray | None = None, name: str = "") -> None:
        """Add parts, of the object ``name`` or of the room itself."""
        self.parts += parts if pose is None else transform_all(parts, pose)
        if name:
            self.names.append(name)
        self.owners += [len(self.names) if name else 0] * len(parts)

    def uniform(self, low: float, high: float) -> float:
        return low + (high - low) * float(self.rng.random())

    def _tinted(self, look: Look) -> Look:
        """Return the surfaces in other colours: cloths and pots of any, woods darker or lighter."""
        look = dict(look)
        for name in TINTED:
            drawn = 0.35 + 0.75 * self.rng.random(3)
            look[name] = replace(look[name], diffuse=triple(np.clip(drawn, 0, 1)))
        for name in ("walnut", "oak"):
            tone = self.uniform(0.55, 1.0) * np.array([1, self.uniform(0.85, 1), 1])
            look[name] = replace(look[name], diffuse=triple(tone))
        look["brass"] = self.draw.varied(look["brass"])
        return look

    # -- the shell ---------------------------------------------------------------------------

    def side(self, number: int) -> tuple[np.ndarray, float]:
        """Return the pose of a wall (0 back, 1 left, 2 right, 3 front), and its length."""
        w, d = self.width / 2, self.depth / 2
        turn, x, z = ((0, -w, -d), (90, -w, d), (-90, w, -d), (180, w, d))[number]
        return translate(x, 0, z) @ rotate("y", turn), (2 * w, 2 * d)[number in (1, 2)]

    def add_shell(self) -> None:
        """Draw floor, ceiling, walls with windows and a door, and the ground outside."""
        white, w, d, h = self.look["white"], self.width, self.depth, self.height
        paint, accent = self._wall_paint(), self._wall_paint()
        count = 1 + (self.rng.random() < 0.6)
        for number in self.rng.permutation(3)[:count].tolist():
            self.windows.append((number, self._window(self.side(number)[1])))
        for number in range(4):
            pose, length = self.side(number)
            windows = [window for at, window in self.windows if at == number]
            one, repeat = accent if number == 0 else paint
            parts = interior.wall(length, h, one, white, windows, repeat)
            self.put(parts, pose)
            for window in windows:
                self.openings[number].append((window.start - 0.1, window.end + 0.1, window.sill))
                self._curtains(pose, window, length)
        floor, repeat = self._floor()
        ceiling = replace(white, name="ceiling")
        self.put([
            rectangle((-w / 2, 0, d / 2), (w, 0, 0), (0, 0, -d), floor, repeat=repeat),
            rectangle((-w / 2, h, -d / 2), (w, 0, 0), (0, 0, d), ceiling),
            self._ground(),
        ])  # fmt: skip
        self._door()

    def _ground(self) -> SurfaceMesh:
        lawn = Surface("ground", triple(0.25 + 0.25 * self.rng.random(3) * (0.8, 1, 0.5)))
        return rectangle((-60, -0.6, 60), (120, 0, 0), (0, 0, -120), lawn)

    def _window(self, length: float) -> Window:
        wide = min(self.uniform(0.8, 2.2), length - 1.0)
        start = self.uniform(0.4, length - 0.4 - wide)
        to_floor = self.rng.random() < 0.15
        sill = 0.06 if to_floor else self.uniform(0.6, 0.95)
        head = min(self.uniform(2.0, 2.3), self.height - 0.12)
        glazed = self.draw.chance(self.draw.description.materials.share_panes)
        return Window(start, start + wide, sill, head, glazed)

    def _curtains(self, pose: np.ndarray, window: Window, length: float) -> None:
        if self.rng.random() < 0.45:
            return
        head = window.head + 0.1
        for x, pull in ((max(window.start - 0.35, 0.02), 1.0), (window.end - 0.2, -1.0)):
            wide = min(0.55, length - x - 0.02)
            drape = softgoods.curtain(
                wide,
                head - 0.03,
                self.look["curtain"],
                seed=int(self.rng.integers(99)),
                pull=pull,
                pieces=(54, 10),
            )
            here = pose @ translate(x, 0.02, 0.13)
            self.put([drape], here)
            low, high = np.array([0.0, -0.11]), np.array([wide, 0.11])
            self.boxes.append(Box(here, low, high, head))

    def _door(self) -> None:
        number = int(self.rng.choice([1, 2, 3]))
        pose, length = self.side(number)
        for _ in range(TRIES):
            x = self.uniform(0.6, length - 0.6)
            if all(x + 0.55 < a or x - 0.55 > b for a, b, _ in self.openings[number]):
                here = pose @ translate(x, 0, 0)
                self.put(interior.door(self.look["white"], self.look["brass"]), here)
                self.openings[number].append((x - 0.55, x + 0.55, 0.0))
                low, high = np.array([-0.5, 0.0]), np.array([0.5, 0.6])
                self.boxes.append(Box(here, low, high, 2.1))
                return

    def _wall_paint(self) -> tuple[Surface, float]:
        """Draw plaster, wallpaper, bricks or a texture of the user's, and its repeats per metre."""
        seed, kind = int(self.rng.integers(1000)), float(self.rng.random())
        tone = triple(np.clip(0.62 + 0.36 * self.rng.random(3), 0, 0.95))
        if self.draw.textures and self.draw.chance(0.4):
            return replace(self.draw.surface("wall"), metallic=0.0), 0.5
        if kind < 0.65:
            picture = textures.plaster(seed, (235, 235, 232), contrast=5)
            return Surface("wall", tone, texture=picture), 0.5
        if kind < 0.87:
            return Surface("wall", tone, texture=pictures.wallpaper(seed)), self.uniform(0.8, 1.3)
        colours = ((150, 90, 70), (190, 130, 105))
        picture = textures.bricks(seed, colours, (200, 195, 185), size=(256, 256))
        return Surface("wall", tone, texture=picture), self.uniform(0.9, 1.3)

    def _floor(self) -> tuple[Surface, float]:
        """Draw boards, a carpet or tiles, and their repeats per metre."""
        seed, kind = int(self.rng.integers(1000)), float(self.rng.random())
        tone = triple(self.uniform(0.6, 1.0) * np.ones(3))
        if self.draw.textures and self.draw.chance(0.4):
            return replace(self.draw.surface("floor"), metallic=0.0), 0.6
        if kind < 0.6:
            dark = np.array([120, 84, 52]) + 60 * self.rng.random() - 30
            boards = textures.planks(seed, tuple(dark), tuple(dark + 55), rows=8)
            return Surface("floor", tone, (0.05,) * 3, 40.0, texture=boards), 0.62
        if kind < 0.8:
            colour = tuple((90 + 130 * self.rng.random(3)).tolist())
            return Surface("floor", tone, texture=textures.weave(seed, colour)), 1.2
        grey = 150 + 60 * float(self.rng.random())
        tiles = textures.bricks(
            seed, ((grey, grey, grey - 5), (grey + 20, grey + 18, grey + 12)), (110, 108, 105),
            size=(256, 256),
        )  # fmt: skip
        return Surface("floor", tone, (0.06,) * 3, 60.0, texture=tiles), 0.7
