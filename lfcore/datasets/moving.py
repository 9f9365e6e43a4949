"""What moves in a scene of a data set: objects with constant velocities, and animated meshes.

The scene at the first instant is that of the same description without ``frames``; a shutter is
open about each instant.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lfcore.scene.assemble import sound_normals
from lfcore.scene.model import Scene
from lfcore.scene.motion import Animation
from lfcore.scene.procedural.basics import Parts
from lfcore.scene.surface_mesh import filled, transform_all
from lfcore.scene.transforms import affine

if TYPE_CHECKING:
    from lfcore.datasets.description import Frames
    from lfcore.datasets.draws import Draw
    from lfcore.datasets.shapes import Shape
    from lfcore.datasets.space import Space

TRIES = 20
"""The velocities that are tried before an object turns in its place."""
CHECKED = 16
"""The most instants at which places are checked."""


class Thing(NamedTuple):
    """An object's number, its shape, and the (4, 4) pose of its sphere in the world."""

    number: int
    shape: Shape
    place: np.ndarray

    @property
    def middle(self) -> np.ndarray:
        return self.place[:3, 3]

    @property
    def radius(self) -> float:
        return float(np.cbrt(abs(np.linalg.det(self.place[:3, :3]))))


@dataclass(frozen=True, eq=False)
class Movement:
    """How an object moves, in camera space.

    Attributes
    ----------
    number : of the object, from 1.
    rows : (K,) numbers of its triangles in the scene.
    middle : (3,) about which it turns, metres, at the time 0.
    velocity, turn : (3,) metres and radians per second; the turn's direction is its axis.
    parts_at : its parts at an instant, of an animated mesh that does not move otherwise.
    kept : which of the parts' triangles the scene has.
    """

    number: int
    rows: np.ndarray
    middle: np.ndarray
    velocity: np.ndarray
    turn: np.ndarray
    parts_at: Callable[[float], Parts] | None
    kept: np.ndarray

    def pose(self, time_s: float) -> np.ndarray:
        """Return (4, 4) that moves the object from the first instant to this one."""
        from scipy.spatial.transform import Rotation  # slow to import

        turn = Rotation.from_rotvec(time_s * self.turn).as_matrix()
        return affine(turn, self.middle + time_s * self.velocity - turn @ self.middle)

    def moved(self, scene: Scene, time_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Return triangles and normals of the object at an instant, float64."""
        triangles = scene.triangles[self.rows].astype(np.float64)
        normals = scene.normals[self.rows].astype(np.float64) if len(scene.normals) else None
        if self.parts_at and time_s > 0:
            parts = self.parts_at(time_s)
            triangles = np.concatenate([part.triangles for part in parts])[self.kept]
            if normals is not None:
                normals = sound_normals(filled(parts, "normals")[self.kept], triangles)
        pose = self.pose(time_s)
        turned = np.zeros((0, 3, 3)) if normals is None else normals @ pose[:3, :3].T
        return triangles @ pose[:3, :3].T + pose[:3, 3], turned


def movements(
    draw: Draw, things: Sequence[Thing], owners: np.ndarray, kept: Sequence[np.ndarray],
    to_camera: np.ndarray, *, upright: bool, space: Space | None,
) -> tuple[Movement, ...]:  # fmt: skip
    """Draw the movements of objects.

    Parameters
    ----------
    owners, kept : of each triangle of the scene the object, and of each thing which triangles of
        its parts the scene has.
    upright : whether things move along the floor and turn about the vertical.
    space : where they may go; None: they turn where they are.
    """
    frames = draw.description.frames
    times = np.linspace(0, frames.times[-1], min(frames.count, CHECKED + 1))[1:]
    times = times if len(times) else np.array([frames.shutter / frames.fps])
    velocities = {thing.number: np.zeros(3) for thing in things}
    turns, moving = dict(velocities), set[int]()
    for thing in things:
        if not draw.chance(frames.share_moving):
            continue
        moving.add(thing.number)
        axis = np.array([0.0, 1.0, 0.0]) if upright else _direction(draw.rng)
        turns[thing.number] = axis * np.radians(draw.span(frames.turn_deg)) * draw.pick((-1, 1))
        speed = 2 * thing.radius * draw.span(frames.speed)
        for _ in range(TRIES if space else 0):
            way = _direction(draw.rng) * (1, 0 if upright else 1, 1)
            velocity = speed * way / np.linalg.norm(way)
            if space and all(
                space.fits(thing.middle + time * velocity, thing.radius, [
                    (other.middle + time * velocities[other.number], other.radius)
                    for other in things if other is not thing
                ]) for time in times
            ):  # fmt: skip
                velocities[thing.number] = velocity
                break
    rotation = to_camera[:3, :3]
    return tuple(
        Movement(
            thing.number, np.flatnonzero(owners == thing.number),
            rotation @ thing.middle + to_camera[:3, 3], rotation @ velocities[thing.number],
            rotation @ turns[thing.number], _parts_at(thing, to_camera), of_thing,
        )
        for thing, of_thing in zip(things, kept, strict=True)
        if thing.number in moving or thing.shape.played
    )  # fmt: skip


def _direction(rng: Any) -> np.ndarray:
    """Draw a direction, evenly."""
    drawn = rng.standard_normal(3)
    return drawn / np.linalg.norm(drawn)


def _parts_at(thing: Thing, to_camera: np.ndarray) -> Callable[[float], Parts] | None:
    played, pose = thing.shape.played, to_camera @ thing.place
    return (lambda time_s: transform_all(played(time_s), pose)) if played else None


def animated(scene: Scene, moves: Sequence[Movement], frames: Frames) -> Scene:
    """Return the scene with its movements, from the time 0 to the last instant, and its shutter."""
    open_s = frames.shutter / frames.fps
    start, end = -open_s / 2, frames.times[-1] + open_s / 2

    def at(now: Scene, time_s: float) -> Scene:
        time_s = min(max(time_s, start), end)
        triangles, normals = now.triangles.copy(), now.normals.copy()
        for move in moves:
            places, turned = move.moved(now, time_s)
            triangles[move.rows] = places
            if len(normals):
                normals[move.rows] = turned
        return replace(now, triangles=triangles, normals=normals)

    shutter = (start, -start) if open_s else None
    return replace(scene, animation=Animation(start, end, at), shutter=shutter)
