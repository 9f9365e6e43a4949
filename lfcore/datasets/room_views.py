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
CONE = (math.cos(math.radians(30)), math.cos(math.radians(89)))
"""The cosines of the angles to the vertical at which a ceiling lamp begins to fade and is dark."""


def camera_of(room: Room) -> np.ndarray:
    """Draw a person's view of the room, or one of things on a table; return (4, 4) to it."""
    if room.tops and room.rng.random() < 0.5:
        sizes = [(top[1] - top[0]) * (top[3] - top[2]) for _, top in room.tops]
        number = room.rng.choice(len(sizes), p=np.array(sizes) / sum(sizes))
        pose, (x0, x1, z0, z1, y) = room.tops[int(number)]
        aim = (pose @ ((x0 + x1) / 2, y + 0.08, (z0 + z1) / 2, 1))[:3]
        for _ in range(TRIES):
            turn, away = room.uniform(0, 2 * math.pi), room.uniform(0.7, 1.2)
            eye = aim + (away * math.sin(turn), room.uniform(0.2, 0.5), away * math.cos(turn))
            if _clear(room, eye):
                return look_at(eye.tolist(), aim.tolist())
    best: tuple[float, Any, Any] = (0.0, (0, 1.4, 0), (0, 1.2, -1))
    for _ in range(TRIES):
        x, z = (room.rng.random(2) - 0.5) * (room.width - 0.5, room.depth - 0.5)
        eye = np.array([x, room.uniform(1.15, 1.75), z])
        aim = np.array([0.0, room.uniform(0.5, 1.0), 0.0])
        aim[[0, 2]] = (room.rng.random(2) - 0.5) * (room.width / 2, room.depth / 2) - eye[
            [0, 2]
        ] / 2
        far = float(np.linalg.norm((aim - eye)[[0, 2]]))
        if far > best[0] and _clear(room, eye):
            best = far, eye.tolist(), aim.tolist()
    return look_at(*best[1:])


def _clear(room: Room, eye: np.ndarray) -> bool:
    """Return whether a point is in the room, and in no furniture nor just before it."""
    near = np.array([0.18, 0.18])
    box = Box(translate(float(eye[0]), 0, float(eye[2])), -near, near, 0.0)
    return room.inside(box) and not any(
        other.height > eye[1] - 0.25 and box.meets(other) for other in room.boxes
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
    tint = np.array([1.0, room.uniform(0.93, 1.0), room.uniform(0.85, 1.0)])
    sky = {
        "horizon": (bright * tint).tolist(),
        "zenith": (bright * tint * (0.5, 0.7, 1.1)).tolist(),
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
