"""Scenes that are difficult for baked light: rooms, contacts, emitters near surfaces, a sun."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh

from lfcore.api import load_scene
from lfcore.pictures import write_picture
from lfcore.scene.model import Scene

WHITE = {"diffuse": [0.9, 0.9, 0.9]}
GREY = {"diffuse": [0.6, 0.6, 0.6]}
RED = {"diffuse": [0.7, 0.2, 0.15]}
BLUE = {"diffuse": [0.2, 0.3, 0.7]}
SKY = {"zenith": [0.5, 0.7, 1.0], "horizon": [0.9, 0.85, 0.8]}
SUN_DEG = 5.0
"""The diameter, degrees, of the sun in the scene ``sun``."""
SUN_HEIGHT = 512
"""The rows of its panorama."""
Part = tuple[trimesh.Trimesh, dict]


def box(low: tuple, high: tuple, material: dict) -> Part:
    return trimesh.creation.box(bounds=[low, high]), material


def things() -> list[Part]:
    """Return objects of 0.2 to 0.5 m on a floor, y = 0, around the origin."""
    ball = trimesh.creation.icosphere(4, radius=0.2).apply_translation((-0.35, 0.2, 0.1))
    pole = trimesh.creation.cylinder(0.05, 0.5, sections=48)
    pole.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (1, 0, 0)))
    ring = trimesh.creation.torus(0.12, 0.04, 48, 24)
    ring.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (1, 0, 0)))
    return [
        (ball, RED), box((-0.05, 0, -0.2), (0.25, 0.3, 0.1), BLUE),
        (pole.apply_translation((0.45, 0.25, 0.05)), GREY),
        (ring.apply_translation((0.15, 0.04, 0.35)), WHITE),
    ]  # fmt: skip


def room(wall: dict) -> list[Part]:
    """Return a closed room of 4 m x 2.6 m x 5 m with a lamp below its ceiling."""
    inside = trimesh.creation.box(bounds=[(-2, 0, -2.5), (2, 2.6, 2.5)])
    lamp = {"diffuse": [0.5, 0.5, 0.5], "emission": [6.0, 5.6, 5.0]}
    return [(inside, wall), box((-0.4, 2.4, -0.9), (0.4, 2.45, -0.5), lamp)]


def closed_room() -> tuple[list[Part], dict]:
    parts = [*room(WHITE), box((-0.9, 0, -1.8), (-0.2, 1.4, -1.1), WHITE),
             box((0.3, 0, -1.2), (1.0, 0.7, -0.5), RED)]  # fmt: skip
    parts[1][1]["emission"] = [0.9, 0.85, 0.75]
    return parts, _camera((0, 1.3, 2.3), (0, 1.1, -1), 28)


def ordinary_room() -> tuple[list[Part], dict]:
    """Return a room with a table, a shelf and a bed."""
    wood = {"diffuse": [0.45, 0.3, 0.18]}
    legs = [box((x, 0, z), (x + 0.06, 0.7, z + 0.06), wood)
            for x in (-1.4, -0.46) for z in (-1.5, -0.9)]  # fmt: skip
    boards = [box((1.1, y, -2.5), (2.0, y + 0.03, -2.2), wood) for y in (0.5, 0.9, 1.3)]
    parts = [
        *room({"diffuse": [0.75, 0.72, 0.68]}), *legs, *boards,
        box((-1.5, 0.7, -1.6), (-0.3, 0.74, -0.8), wood),
        box((0.5, 0.0, -1.7), (1.9, 0.45, 0.2), BLUE),
        box((-1.1, 0.74, -1.3), (-0.8, 0.95, -1.1), RED),
    ]  # fmt: skip
    return parts, _camera((0, 1.5, 2.3), (0, 0.9, -1.5), 28)


def floor(size: float) -> tuple[list[Part], dict]:
    """Return objects on a floor ``size`` m wide under an even sky."""
    half = size / 2
    parts = [*things(), box((-half, -0.05, -half), (half, 0, half), GREY)]
    return parts, {**_camera((0.3, 0.7, 2.0), (0, 0.15, 0), 40), "sky": SKY}


def cards() -> tuple[list[Part], dict]:
    """Return cards 18 mm apart on a floor of 6 m."""
    parts = [box((-3, -0.05, -3), (3, 0, 3), GREY)]
    for number in range(9):
        x, colour = 0.018 * (number - 4), (WHITE, RED, BLUE)[number % 3]
        parts.append(box((x, 0, -0.06), (x + 0.001, 0.09, 0.06), colour))
    return parts, {**_camera((0.12, 0.28, 0.3), (0, 0.035, 0), 35), "sky": SKY}


def shelf() -> tuple[list[Part], dict]:
    """Return an emitting strip, half a millimetre below a shelf."""
    strip = {"diffuse": [0.5, 0.5, 0.5], "emission": [14.0, 12.0, 9.0]}
    corners = [
        (x, 0.5995, z) for x, z in ((-0.5, -0.06), (0.5, -0.06), (0.5, -0.04), (-0.5, -0.04))
    ]
    sheet = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]])
    parts = [
        box((-1.5, -0.05, -0.3), (1.5, 0, 1.5), GREY),
        box((-1.5, 0, -0.35), (1.5, 1.5, -0.3), WHITE),
        box((-0.6, 0.6, -0.3), (0.6, 0.63, 0.0), GREY),
        (sheet, strip),
        box((-0.3, 0, -0.25), (-0.1, 0.25, -0.05), RED),
    ]  # fmt: skip
    return parts, {**_camera((0.2, 0.45, 2.0), (0, 0.35, -0.2), 40)}


def sun(folder: Path) -> tuple[list[Part], dict]:
    """Return objects on a floor, under a sky with a large sun."""
    height = SUN_HEIGHT
    turn, polar = np.meshgrid(
        ((np.arange(2 * height) + 0.5) / (2 * height) - 0.5) * 2 * np.pi,
        (np.arange(height) + 0.5) / height * np.pi,
    )
    d = np.stack([np.sin(turn) * np.sin(polar), np.cos(polar), -np.cos(turn) * np.sin(polar)], -1)
    towards = np.array([-0.6, 0.5, -0.5]) / np.linalg.norm([-0.6, 0.5, -0.5])
    disc = d @ towards > np.cos(np.radians(SUN_DEG / 2))
    light = np.where(disc[..., None], 400.0, 0.25) * np.array([1.0, 0.95, 0.9])
    write_picture(folder / "sun.exr", light.astype(np.float32))
    parts, keys = floor(6.0)
    return parts, {**keys, "sky": {"file": "sun.exr"}}


def _camera(position: tuple, target: tuple, focal_mm: float) -> dict:
    pose = {"position_m": list(position), "look_at_m": list(target)}
    distance = float(np.linalg.norm(np.subtract(target, position)))
    lens = {"focal_length_mm": focal_mm, "sensor_width_mm": 36, "f_number": 8}
    return {"camera": {**lens, "focus_m": round(distance, 3), "pose": pose}}


MADE: dict[str, Callable[[Path], tuple[list[Part], dict]]] = {
    "closed room": lambda folder: closed_room(),
    "room": lambda folder: ordinary_room(),
    "floor 6 m": lambda folder: floor(6.0),
    "floor 1.6 m": lambda folder: floor(1.6),
    "cards": lambda folder: cards(),
    "shelf": lambda folder: shelf(),
    "sun": sun,
}


def made_scene(name: str, folder: Path) -> Scene:
    """Write a scene of :data:`MADE` to a folder, and read it."""
    parts, keys = MADE[name](folder)
    objects = []
    for number, (mesh, material) in enumerate(parts):
        mesh.export(folder / f"{number}.ply")
        objects.append({"file": f"{number}.ply", "material": material})
    description = {"name": name, "lights": [], "background": [0, 0, 0], **keys, "objects": objects}
    if "sky" not in description:
        description["bounces"] = "all"
    (folder / "scene.yaml").write_text(json.dumps(description))
    return load_scene(folder / "scene.yaml")
