"""The camera and the light of a room."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from lfcore.datasets.room_shell import TRIES, Box
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light
from lfcore.scene.baked import BakeOptions
from lfcore.scene.surface_mesh import triple
from lfcore.scene.transforms import look_at, rotate, translate

if TYPE_CHECKING:
    from lfcore.datasets.rooms import Room

BAKE = BakeOptions(bounces=2, error=0.06, cells=12)
"""The bake of rooms."""
RAYS = (16, 12)
"""The rays per row and column that check a view."""
CLEAR_M = 0.45
"""The least depth in a picture, metres."""
WALL_M, MOST_WALL = 1.0, 0.25
"""The depth up to which a wall is near, and the most of the picture that near walls and the floor
fill."""
MOST_SHARE = 0.55
"""The most of the picture that one thing fills."""
LEAST_THINGS, LEAST_SHARE = 3, 0.01
"""The least number of things in the picture, each of which fills at least this share."""
CONE = (math.cos(math.radians(30)), math.cos(math.radians(89)))
"""The cosines of the angles to the vertical at which a ceiling lamp begins to fade and is dark."""


def camera_of(room: Room, field: np.ndarray) -> np.ndarray:
    """Draw a person's view of the room, or one of things on a table; return (4, 4) to it.

    ``field`` is the width and height of what the camera sees at a distance of 1 m.
    """
    found: list[tuple[float, float, np.ndarray]] = []
    ways = [_at_table, _standing] if room.tops and room.rng.random() < 0.5 else [_standing]
    for draw in ways:
        for _ in range(TRIES):
            eye, aim = draw(room)
            if _is_free(room, eye):
                to_camera = look_at(eye.tolist(), aim.tolist())
                away = float(np.linalg.norm((aim - eye)[[0, 2]])) * (draw is _standing)
                found.append((-_faults(room, eye, to_camera, field), away, to_camera))
        if any(not faults for faults, *_ in found):
            break
    if not found:
        return look_at((0, 1.4, 0), (0, 1.2, -1))
    return max(found, key=lambda one: one[:2])[2]


def _at_table(room: Room) -> tuple[np.ndarray, np.ndarray]:
    """Draw an eye near a table, and the place above it that it looks at."""
    sizes = [(top[1] - top[0]) * (top[3] - top[2]) for _, top in room.tops]
    number = room.rng.choice(len(sizes), p=np.array(sizes) / sum(sizes))
    pose, (x0, x1, z0, z1, y) = room.tops[int(number)]
    aim = (pose @ ((x0 + x1) / 2, y + 0.08, (z0 + z1) / 2, 1))[:3]
    turn, away = room.uniform(0, 2 * math.pi), room.uniform(0.7, 1.2)
    return aim + (away * math.sin(turn), room.uniform(0.2, 0.5), away * math.cos(turn)), aim


def _standing(room: Room) -> tuple[np.ndarray, np.ndarray]:
    """Draw an eye at a person's height, and a place beyond the middle of the room."""
    x, z = (room.rng.random(2) - 0.5) * (room.width - 0.5, room.depth - 0.5)
    eye = np.array([x, room.uniform(1.15, 1.75), z])
    aim = np.array([0.0, room.uniform(0.5, 1.0), 0.0])
    aim[[0, 2]] = (room.rng.random(2) - 0.5) * (room.width / 2, room.depth / 2) - eye[[0, 2]] / 2
    return eye, aim


def _is_free(room: Room, eye: np.ndarray) -> bool:
    """Return whether a point is in the room, and in no furniture nor just before it."""
    near = np.array([0.18, 0.18])
    box = Box(translate(float(eye[0]), 0, float(eye[2])), -near, near, 0.0)
    return room.inside(box) and not any(
        other.height > eye[1] - 0.25 and box.meets(other) for other in room.boxes
    )


def _faults(
    room: Room, eye: np.ndarray, to_camera: np.ndarray, field: np.ndarray
) -> float:  # fmt: skip
    """Return by how much a view is too near to walls or to one thing, or too empty; 0: it is good.

    Boxes represent furniture and things.
    """
    columns, rows = ((np.arange(count) + 0.5) / count - 0.5 for count in RAYS)
    rays = np.ones((*RAYS, 3))
    rays[..., 0], rays[..., 1] = columns[:, None] * field[0], rows * field[1]
    towards = rays.reshape(-1, 3) @ to_camera[:3, :3]  # the inverse's rotation
    half = np.array([room.width / 2, room.height, room.depth / 2])
    ends = np.where(towards > 0, half - eye, np.array([-half[0], 0, -half[2]]) - eye)
    with np.errstate(divide="ignore", invalid="ignore"):
        nearest = np.nanmin(ends / towards, axis=1)
    seen = np.zeros(len(nearest), int)
    for number, box in enumerate((*room.boxes, *room.small_boxes), 1):
        depth = box.depths(eye, towards)
        seen[depth < nearest] = number
        nearest = np.minimum(depth, nearest)
    shares = np.bincount(seen) / len(seen)
    walls = float(((seen == 0) & (nearest < WALL_M)).mean())
    things = int((shares[1:] > LEAST_SHARE).sum())
    return (
        max(0.0, CLEAR_M - float(nearest.min()))
        + max(0.0, walls - MOST_WALL)
        + max(0.0, float(shares[1:].max(initial=0)) - MOST_SHARE)
        + max(0, LEAST_THINGS - things)
    )


def light_of(room: Room, to_camera: np.ndarray) -> tuple[list[Light], dict[str, Any]]:
    """Draw lamps, and the keys of a sky: by day with or without sun, or at night."""
    night = room.rng.random() < 0.15
    lights, warm = [], np.array([1.0, 0.84, 0.62])
    # The ceiling lamp shines downwards only: a bright spot above it would be noise in the bake.
    for place, reach in zip(room.lamps, [0.7] * (len(room.lamps) - 1) + [1.6], strict=True):
        share = (1.8 if night else 1.6) * room.uniform(0.8, 1.2)
        where, down = (to_camera @ (*place, 1))[:3], to_camera[:3, :3] @ (0.0, -1.0, 0.0)
        lamp = Light(POINT, triple(where), triple(share * warm), reference_distance_m=reach)
        is_spot = reach > 1
        lights.append(replace(lamp, normal=triple(down), cone=CONE) if is_spot else lamp)
    bright = 0.02 if night else room.uniform(2.5, 5.0)
    tint = room.uniform(0.0, 0.15)  # green lies between red and blue, or skies were lilac
    sky = {
        "horizon": (bright * np.array([1.0, 1 - tint / 2, 1 - tint])).tolist(),
        "zenith": (bright * np.array([0.45, 0.7, 1.1])).tolist(),
    }
    if not night and room.rng.random() < 0.6:
        number, _ = room.windows[0]
        outward = -room.side(number)[0][:3, 2]
        turn, rise = (
            rotate("y", room.uniform(-50, 50))[:3, :3],
            math.radians(room.uniform(18, 50)),
        )
        towards = turn @ outward * math.cos(rise) + (0, math.sin(rise), 0)
        colour = room.uniform(1.0, 2.2) * np.array([1.0, 0.93, 0.8])
        lights.append(Light(DIRECTIONAL, triple(to_camera[:3, :3] @ towards), triple(colour)))
    return lights, sky
