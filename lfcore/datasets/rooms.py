"""Furnished rooms: walls with windows, sky outside, furniture and things that stand on it.

A room is drawn in world space, y up, with the floor on y = 0 and the middle at x = z = 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lfcore.datasets.moving import Thing
from lfcore.scene.procedural import furniture, interior, pictures, softgoods, textures
from lfcore.scene.procedural.basics import Look, Parts
from lfcore.scene.procedural.bedroom import surfaces
from lfcore.scene.procedural.interior import Window
from lfcore.scene.procedural.primitives import rectangle
from lfcore.scene.procedural.turned import sphere
from lfcore.scene.surface_mesh import Surface, transform_all, triple
from lfcore.scene.transforms import rotate, scale, translate

if TYPE_CHECKING:
    from lfcore.datasets.sample import Draw

DETAIL = 0.4
"""The pieces of cloths per side, relative to those of the bedroom."""
TRIES = 30
"""The positions that are tried before a thing is left out."""
LOOKS = 4
"""The sets of textures of furniture; their colours vary per room."""
GAP_M = 0.02
"""The least distance between things, metres."""
TINTED = ("blush", "mustard", "stripe", "quilt", "knit", "velvet", "velvet 2", "curtain", "glaze",
          "rug", "tulip", "books")  # fmt: skip
"""The surfaces whose colours vary."""
SMALL = ("ball", "block", "blob", "cone", "ring", "vase", "tower", "book", "globe", "lamp")
"""The shapes that stand on furniture."""
ON_FLOOR = ("ball", "block", "train", "tower", "plant", "vase", "cone", "ring")
"""The shapes that stand on the floor."""


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

    def meets(self, other: Box, gap: float = GAP_M) -> bool:
        """Return whether two rectangles are nearer than ``gap``, by separating axes."""
        a, b = self.corners(), other.corners()
        for pose in (self.pose, other.pose):
            for axis in (pose[[0, 2], 0], pose[[0, 2], 2]):
                p, q = a @ axis, b @ axis
                if p.min() > q.max() + gap or q.min() > p.max() + gap:
                    return False
        return True


@dataclass(frozen=True)
class Piece:
    """Furniture: parts with the back at z = 0, and rectangles (x0, x1, z0, z1, y) for things."""

    name: str
    parts: Parts
    tops: tuple[tuple[float, ...], ...] = ()
    at_wall: bool = True

    def box(self, pose: np.ndarray) -> Box:
        points = np.concatenate([part.triangles.reshape(-1, 3) for part in self.parts])
        low, high = points.min(0), points.max(0)
        return Box(pose, low[[0, 2]], high[[0, 2]], float(high[1]))


@lru_cache(maxsize=LOOKS)
def _look(number: int) -> Look:
    return surfaces(100 + number)


class Room:
    """The draws of one room; ``draw`` has the description, and draws materials and shapes."""

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

    def _ground(self) -> Any:
        lawn = Surface("ground", triple(0.25 + 0.25 * self.rng.random(3) * (0.8, 1, 0.5)))
        return rectangle((-60, -0.6, 60), (120, 0, 0), (0, 0, -120), lawn)

    def _window(self, length: float) -> Window:
        wide = min(self.uniform(0.8, 2.2), length - 1.0)
        start = self.uniform(0.4, length - 0.4 - wide)
        to_floor = self.rng.random() < 0.15
        sill = 0.06 if to_floor else self.uniform(0.6, 0.95)
        return Window(start, start + wide, sill, min(self.uniform(2.0, 2.3), self.height - 0.12))

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

    # -- furniture ---------------------------------------------------------------------------

    def furnish(self) -> None:
        """Draw furniture, large pieces first, then a rug, prints, things and a ceiling lamp."""
        for kind in self._kinds():
            piece = self._piece(kind)
            pose = self._at_wall(piece) if piece.at_wall else self._free(piece)
            if pose is not None:
                self.put(piece.parts, pose, kind)
                self.boxes.append(piece.box(pose))
                self.tops += [(pose, top) for top in piece.tops]
                if kind == "floor lamp":
                    self.lamps.append((pose @ (0, 1.45, 0.2, 1))[:3])
        self._rug()
        for number in range(4):
            self._print(number)
        self._things()
        lantern = Surface("lantern", (0.8, 0.76, 0.66), emission=(0.5, 0.42, 0.3))
        self.put([sphere((0.2, 0.18, 0.2), lantern).at(0, self.height - 0.32, 0)])
        self.lamps.append(np.array([0.0, self.height - 0.55, 0.0]))

    def _kinds(self) -> list[str]:
        large = ["bed", "sofa", "dining set"]
        kinds = [str(self.rng.choice(large))]
        more = ["sofa", "dining set", "cabinet", "sideboard", "bookshelf", "desk", "armchair",
                "night table", "coffee table", "tulip table", "plant", "floor lamp", "chair",
                "bookshelf", "armchair", "plant"]  # fmt: skip
        order = self.rng.permutation(len(more))[: 6 + int(self.rng.integers(6))]
        return kinds + [more[k] for k in sorted(order.tolist())]

    def _piece(self, kind: str) -> Piece:
        look, rng, seed = self.look, self.rng, int(self.rng.integers(1000))
        wood = look["walnut" if rng.random() < 0.5 else "oak"]
        cloth = look["velvet" if rng.random() < 0.5 else "velvet 2"]
        if kind == "bed":
            return Piece(kind, [part.at(0, 0, 0.06) for part in furniture.bed(seed, look, DETAIL)])
        if kind == "sofa":
            wide = self.uniform(1.5, 2.2)
            return Piece(kind, interior.sofa(wide, cloth, look["stripe"], wood, seed))
        if kind in ("cabinet", "sideboard"):
            low = kind == "sideboard"
            wide, tall = self.uniform(0.8, 1.6), self.uniform(*((0.6, 0.95) if low else (1.7, 2.1)))
            deep, doors = self.uniform(0.38, 0.5), max(2, round(wide / 0.45))
            body = look["white"] if rng.random() < 0.35 else wood
            parts = interior.cabinet(
                wide,
                tall,
                deep,
                body,
                look["brass"],
                doors=doors,
                drawers=low * int(rng.integers(3)),
            )
            top = (-wide / 2 + 0.03, wide / 2 - 0.03, 0.03, deep - 0.05, tall)
            return Piece(kind, parts, (top,) * low)
        if kind == "bookshelf":
            shelf = furniture.bookshelf(rng, look, 0.98)
            return Piece(kind, [part.at(-0.49, 0, 0.03) for part in shelf])
        if kind == "desk":
            wide, deep = self.uniform(1.0, 1.5), self.uniform(0.55, 0.7)
            top = (-wide / 2 + 0.04, wide / 2 - 0.04, 0.04, deep - 0.04, 0.74)
            return Piece(kind, interior.table(wide, 0.74, deep, wood, rng), (top,))
        if kind == "night table":
            parts = [part.at(0, 0, 0.2) for part in furniture.night_table(look)]
            return Piece(kind, parts, ((-0.2, 0.2, 0.04, 0.36, 0.52),))
        if kind == "dining set":
            parts, wide, deep = interior.dining_set(rng, wood, cloth)
            top = (-wide / 2 + 0.05, wide / 2 - 0.05, -deep / 2 + 0.05, deep / 2 - 0.05, 0.75)
            return Piece(kind, parts, (top,), at_wall=False)
        if kind == "coffee table":
            wide, deep, tall = (
                self.uniform(0.7, 1.1),
                self.uniform(0.45, 0.6),
                self.uniform(0.36, 0.46),
            )
            top = (-wide / 2 + 0.04, wide / 2 - 0.04, 0.04, deep - 0.04, tall)
            return Piece(kind, interior.table(wide, tall, deep, wood, rng), (top,), at_wall=False)
        parts = {
            "armchair": lambda: furniture.armchair(seed, look, DETAIL),
            "tulip table": lambda: furniture.tulip_table(rng, look),
            "plant": lambda: furniture.potted_plant(rng, look),
            "floor lamp": lambda: [
                part.at(0, 0, 0.2) for part in interior.floor_lamp(look["shade"], look["brass"])
            ],
            "chair": lambda: interior.chair(wood, cloth),
        }[kind]()
        return Piece(kind, parts, at_wall=kind == "floor lamp")

    def _poses_at_wall(self, box: Box) -> Iterator[tuple[int, np.ndarray, tuple[float, float]]]:
        half = (box.high[0] - box.low[0]) / 2
        middle = (box.high[0] + box.low[0]) / 2
        for _ in range(TRIES):
            number = int(self.rng.integers(4))
            pose, length = self.side(number)
            if length > 2 * half + 0.1:
                x = self.uniform(half + 0.05, length - half - 0.05)
                here = translate(x - middle, 0, GAP_M - min(box.low[1], 0.0))
                yield number, pose @ here, (x - half, x + half)

    def _at_wall(self, piece: Piece) -> np.ndarray | None:
        """Return a pose against a wall, before no window or door that the piece would cover."""
        box = piece.box(np.eye(4))
        for number, pose, (a, b) in self._poses_at_wall(box):
            open_ = all(b < start or a > end or box.height < sill
                        for start, end, sill in self.openings[number])  # fmt: skip
            if open_ and not any(piece.box(pose).meets(other) for other in self.boxes):
                return pose
        return None

    def _free(self, piece: Piece) -> np.ndarray | None:
        """Return a pose on the floor, away from everything."""
        for _ in range(TRIES):
            x, z = (self.rng.random(2) - 0.5) * (self.width - 0.6, self.depth - 0.6)
            turn = 90 * int(self.rng.integers(4)) + self.uniform(-12, 12)
            if piece.name == "armchair":  # it faces the middle
                turn = math.degrees(math.atan2(-x, -z)) + self.uniform(-30, 30)
            pose = translate(float(x), 0, float(z)) @ rotate("y", turn)
            if self.inside(box := piece.box(pose)) and not any(map(box.meets, self.boxes)):
                return pose
        return None

    def inside(self, box: Box) -> bool:
        x, z = np.abs(box.corners()).max(0)
        return bool(x < self.width / 2 - GAP_M and z < self.depth / 2 - GAP_M)

    def _rug(self) -> None:
        wide, deep = self.uniform(1.2, 1.9), self.uniform(0.9, 1.3)
        x, z = (self.rng.random(2) - 0.5) * (self.width - wide - 0.6, self.depth - deep - 0.6)
        pose = translate(float(x), 0.004, float(z)) @ rotate("y", self.uniform(-8, 8))
        carpet = softgoods.rug(wide, deep, self.look["rug"], self.look["fringe"], seed=1)
        piece = Piece("rug", carpet)
        # Nothing stands half on it: it is 2 cm high.
        if not any(piece.box(pose).meets(other, 0.0) for other in self.boxes):
            self.put(carpet, pose, "rug")

    def _print(self, number: int) -> None:
        """Hang prints on a wall, above furniture and beside windows and doors."""
        pose, length = self.side(number)
        taken = [(a, b) for a, b, _ in self.openings[number]]
        for _ in range(int(self.rng.integers(4))):
            wide = self.uniform(0.3, 0.75)
            tall = wide * self.uniform(0.8, 1.35)
            for _ in range(TRIES):
                x, y = self.uniform(wide, length - wide), self.uniform(1.35, 1.7)
                here = pose @ translate(x, y - tall / 2, 0)
                a, b = x - wide / 2 - 0.06, x + wide / 2 + 0.06
                low, high = np.array([-wide / 2, 0.0]), np.array([wide / 2, 0.12])
                behind = Box(here, low, high, 0.0)
                if any(a < end and b > start for start, end in taken) or any(
                    behind.meets(other, 0.0) and other.height > y - tall / 2 for other in self.boxes
                ):
                    continue
                taken.append((a, b))
                frame = self.look[str(self.rng.choice(["oak", "walnut", "white", "button"]))]
                thick = self.uniform(0.015, 0.04)
                parts = interior.framed(self._picture(), frame, wide, tall, thick)
                self.put(parts, here, "print")
                break

    def _picture(self) -> Surface:
        if self.draw.textures and self.draw.chance(0.6):
            return replace(self.draw.surface("print"), metallic=0.0, diffuse=(0.95,) * 3)
        picture = pictures.art_print(int(self.rng.integers(1000)), int(self.rng.integers(3)))
        return Surface("print", (0.95,) * 3, texture=picture)

    # -- things ------------------------------------------------------------------------------

    def _things(self) -> None:
        """Stand shapes on furniture and on the floor, apart from each other."""
        for pose, (x0, x1, z0, z1, y) in self.tops:
            circles: list[tuple[float, float, float]] = []
            for _ in range(1 + int(6 * (x1 - x0) * (0.4 + self.rng.random()))):
                radius = self.uniform(0.05, min(0.17, (z1 - z0) / 2, (x1 - x0) / 2))
                shape = self.draw.shape(SMALL)
                for _ in range(TRIES):
                    x, z = (
                        self.uniform(x0 + radius, x1 - radius),
                        self.uniform(z0 + radius, z1 - radius),
                    )
                    if all(math.hypot(x - a, z - b) > radius + r + 0.005 for a, b, r in circles):
                        circles.append((x, z, radius))
                        self._stand(shape, pose @ translate(x, y + 5e-4, z), radius)
                        break
        for _ in range(int(self.rng.integers(2, 7))):
            radius, shape = self.uniform(0.08, 0.3), self.draw.shape(ON_FLOOR)
            if box := self._free_circle(radius):
                self.boxes.append(box)
                self._stand(shape, box.pose @ translate(0, 5e-4, 0), radius)

    def _free_circle(self, radius: float) -> Box | None:
        low = np.array([-radius, -radius])
        for _ in range(TRIES):
            x, z = (self.rng.random(2) - 0.5) * (self.width, self.depth)
            box = Box(translate(float(x), 0, float(z)), low, -low, 2 * radius)
            if self.inside(box) and not any(map(box.meets, self.boxes)):
                return box
        return None

    def _stand(self, shape: Any, pose: np.ndarray, radius: float) -> None:
        place = pose @ scale(radius) @ self.draw.pose_at_rest(shape)
        self.put(self.draw.dressed(shape), place, shape.name)
        self.things.append(Thing(len(self.names), shape, place))
