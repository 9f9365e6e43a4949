"""Furnished rooms: walls with windows, sky outside, furniture and things that stand on it.

A room is drawn in world space, y up, with the floor on y = 0 and the middle at x = z = 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lfcore.datasets.moving import Thing
from lfcore.datasets.room_shell import GAP_M, TRIES, Box, Shell
from lfcore.scene.procedural import furniture, interior, pictures, softgoods
from lfcore.scene.procedural.basics import Parts
from lfcore.scene.procedural.turned import sphere
from lfcore.scene.surface_mesh import Surface
from lfcore.scene.transforms import rotate, scale, translate

DETAIL = 0.4
"""The pieces of cloths per side, relative to those of the bedroom."""
SMALL = ("ball", "block", "blob", "cone", "ring", "vase", "tower", "book", "globe", "lamp",
         "bottle", "tumbler", "goblet", "bowl", "pan")  # fmt: skip
"""The shapes that stand on furniture."""
RADII_M = {
    "ball": (0.04, 0.1),
    "vase": (0.1, 0.2), "book": (0.13, 0.17), "globe": (0.12, 0.18), "lamp": (0.2, 0.28),
    "bottle": (0.13, 0.17), "tumbler": (0.05, 0.075), "goblet": (0.085, 0.11), "bowl": (0.08, 0.14),
    "pan": (0.18, 0.24),
}  # fmt: skip
"""The radii of spheres around things of a known size; others vary more."""
ON_FLOOR = ("ball", "block", "train", "tower", "plant", "vase", "cone", "ring")
"""The shapes that stand on the floor."""


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


class Room(Shell):
    """The draws of one room."""

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
        wood = self.draw.coated(look["walnut" if rng.random() < 0.5 else "oak"])
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
        """Hang prints and mirrors on a wall, above furniture and beside windows and doors."""
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
                picture = self._picture()
                parts = interior.framed(picture, frame, wide, tall, thick)
                self.put(parts, here, picture.name)
                break

    def _picture(self) -> Surface:
        if self.draw.chance(self.draw.description.materials.share_mirrors):
            return Surface("mirror", (0.92,) * 3, metallic=1.0, roughness=0.0)
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
                shape = self.draw.shape(SMALL)
                low, high = RADII_M.get(shape.name, (0.04, 0.13))
                most = min((z1 - z0) / 2, (x1 - x0) / 2)
                if low > most:
                    continue
                radius = self.uniform(low, min(high, most))
                for _ in range(TRIES):
                    x, z = (
                        self.uniform(x0 + radius, x1 - radius),
                        self.uniform(z0 + radius, z1 - radius),
                    )
                    if all(math.hypot(x - a, z - b) > radius + r + 0.005 for a, b, r in circles):
                        circles.append((x, z, radius))
                        place = pose @ translate(x, y + 5e-4, z)
                        self._stand(shape, place, radius)
                        side = np.array([radius, radius]) * 0.7  # most things do not fill spheres
                        self.small_boxes.append(Box(place, -side, side, 1.4 * radius))
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
