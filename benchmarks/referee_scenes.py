"""The referee's twelve scenes, each with a lens that blurs its ends equally."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

import lfcore
from benchmarks.mirror_scenes import CAMERA, CASES, ball, block, checked, sheet
from benchmarks.sample import SCENES
from lfcore.scene.assemble import assemble
from lfcore.scene.model import Scene
from lfcore.scene.surface_mesh import Surface, SurfaceMesh

BLUR_PX = 6.0
"""The radius of blur at the nearest and the farthest things, pixels."""
ENDS = (0.02, 0.98)
"""The shares of pixels that are nearer, or farther, than those."""
LENS = {"focal_length_mm": 24, "sensor_width_mm": 24}
ROOMS = {"name": "rooms", "kind": "focal_stacks", "seed": 4, "lens": LENS | {"focus_m": [1, 4]},
         "placement": {"share_rooms": 1}}  # fmt: skip
TOYS = {"name": "toys", "kind": "focal_stacks", "seed": 7, "lens": LENS | {"focus_m": [1, 4]},
        "placement": {"depth_m": [0.8, 6, "log"], "wall_m": [7, 9]}}  # fmt: skip


def sampled(keys: dict[str, Any], index: int) -> Scene:
    return lfcore.sample_scene(keys, index)


def case(name: str) -> Scene:
    return CASES[name]().scene(name)


def built(name: str, parts: list[SurfaceMesh]) -> Scene:
    arrays = assemble(parts, np.eye(4)).arrays
    return Scene(name=name, camera=CAMERA, lights=[], ambient=(1.0, 1.0, 1.0), **arrays)


def lamps() -> Scene:
    """Small lamps, thirty times white, in front of and behind the focus, in a dim room."""
    lamp = Surface("lamp", (0.0, 0.0, 0.0), emission=(30.0, 24.0, 14.0))
    wall = checked("wall", 5, (20, 22, 40), (70, 60, 50), 12)
    parts = [sheet((0, 0, 6), (6, 0, 0), (0, 6, 0), wall)]
    for number, z in enumerate((1.2, 1.5, 2.2, 3.0, 4.0, 5.0, 5.6)):
        x, y = 0.3 * z * np.cos(2.4 * number), 0.3 * z * np.sin(2.4 * number)
        post = checked(f"post {number}", number, (60, 50, 40), (120, 100, 90))
        low, high = (x - 0.02 * z, y + 0.012 * z, z - 0.02), (x + 0.02 * z, 9, z + 0.02)
        parts += [ball((x, y, z), 0.012 * z, lamp), block(low, high, post)]
    return built("lamps", parts)


def wires() -> Scene:
    """Wires at three depths in front of a wall with a pattern."""
    wall = checked("wall", 9, (40, 90, 130), (235, 225, 200), 24)
    parts = [sheet((0, 0, 5), (5, 0, 0), (0, 5, 0), wall)]
    for z, count in ((1.4, 7), (2.3, 9), (3.6, 11)):
        for place in np.linspace(-0.42, 0.42, count) * z:
            tone = (200, 60, 40) if z < 2 else (250, 250, 245) if z < 3 else (30, 30, 30)
            wire, half = checked("wire", 3, tone, tone), 0.003 * z
            parts.append(block((place - half, -3, z - half), (place + half, 3, z + half), wire))
            if z > 2:
                parts.append(block((-3, place - half, z), (3, place + half, z + half), wire))
    return built("wires", parts)


OPENED: dict[str, Callable[[], Scene]] = {
    "room, from afar": partial(sampled, ROOMS, 0), "room, a table": partial(sampled, ROOMS, 1),
    "room, a desk": partial(sampled, ROOMS, 2), "toys": partial(sampled, TOYS, 1),
    **{name: partial(lfcore.load_scene, SCENES / name)
       for name in ("bike", "cabin", "bedroom", "chart")},
    "lamps": lamps, "wires": wires,
    **{name: partial(case, name) for name in ("plane mirror", "glass ball")},
}  # fmt: skip
"""The scenes by name; bike and cabin have foliage."""


def with_lens(scene: Scene, depth: np.ndarray) -> Scene:
    """Return the scene with a focus in the middle of its dioptres, and the aperture that blurs
    both ends by BLUR_PX; ``depth`` is that of its pinhole picture."""
    camera = scene.camera
    far, near = np.quantile(1 / depth.astype(np.float64), ENDS)
    focused = replace(camera, focus_m=2 / (near + far))
    opening = 2 * BLUR_PX * focused.field_width / len(depth) / ((near - far) / 2)  # metres
    return replace(scene, camera=replace(focused, f_number=camera.focal_length_m / opening))
