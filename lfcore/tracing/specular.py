"""Specular rays: what mirrors, glass, coats and veils show, and where it appears.

A path is a ray from the lens that surfaces reflect or let pass.  The kernel takes paths one surface
further at a time (``kernels/paths/``); what arrives from them is added here.  A ray's *own* part
is the light of its first surface, its *specular* part all that this surface shows.
"""

from typing import NamedTuple

import numpy as np

from lfcore.opencl.device import page_aligned
from lfcore.opencl.interface import record
from lfcore.scene.model import Scene
from lfcore.scene.needs import is_specular
from lfcore.tracing.device_scene import DeviceScene
from lfcore.tracing.job import launch_given
from lfcore.tracing.layouts import ARRIVED, PATH, PATH_ARGUMENTS

MOST_EVENTS = 8
"""The most reflections and transmissions of a path."""
NEAREST = 4.0
"""The largest inverse depth at which something appears, in inverse depths of the first surface:
rays near a focus of curved glass have any."""
BATCH = 1 << 16
"""Rays whose paths are followed together: 30 MB."""


class SeenParts(NamedTuple):
    """What R rays see.

    Attributes
    ----------
    own, specular : (R, 3) float32
        Linear RGB radiance of both parts.
    own_depth, specular_depth : (R,) float32
        Depths at which they appear, metres; infinity for what is far, or for nothing.
    cut : (R,) float32
        The mean weight of rays that are not followed.
    """

    own: np.ndarray
    own_depth: np.ndarray
    specular: np.ndarray
    specular_depth: np.ndarray
    cut: np.ndarray


def specular_triangles(scene: Scene) -> np.ndarray:
    """The mask (T,) of triangles from which rays go on."""
    goes_on = np.array([is_specular(scene, material) for material in scene.every_material], bool)
    return goes_on[scene.material_ids]


def follow(
    scene: DeviceScene,
    origins: np.ndarray,
    directions: np.ndarray,
    pixel_pitch: float,
    most_events: int = MOST_EVENTS,
) -> SeenParts:
    """Follow rays (R, 3) from the lens, whose directions have z = 1; textures are filtered over the
    tangent ``pixel_pitch``."""
    batches = []
    for first in range(0, len(origins), BATCH):
        part = slice(first, first + BATCH)
        paths = _first_paths(origins[part], directions[part])
        batches.append(_follow(scene, paths, pixel_pitch, most_events))
    if not batches:
        batches = [_follow(scene, np.zeros(0, PATH), pixel_pitch, most_events)]
    return SeenParts(*(np.concatenate(parts) for parts in zip(*batches, strict=True)))


def _first_paths(origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(R,) PATH with the differentials of rays from (s, t, 0) in direction (x, y, 1)."""
    paths = np.zeros(len(origins), PATH)
    wide = directions.astype(np.float64)
    length = np.sqrt(wide[:, 0] ** 2 + wide[:, 1] ** 2 + wide[:, 2] ** 2)[:, None]
    unit = wide / length
    paths["number"], paths["weight"] = np.arange(len(paths)), 1
    paths["media"] = paths["last"] = -1
    paths["origin"], paths["direction"] = origins, unit
    for axis in (0, 1):
        paths["point"][:, axis, axis] = 1
        step = np.zeros(3)
        step[axis] = 1
        paths["turn"][:, 2 + axis] = (step - unit[:, axis, None] * unit) / length
    return paths


def _follow(
    scene: DeviceScene, paths: np.ndarray, pixel_pitch: float, most_events: int
) -> SeenParts:
    count = len(paths)
    light, depths = np.zeros((2 * count, 3)), np.zeros(2 * count, np.float32)
    strongest, cut = np.zeros(2 * count, np.float32), np.zeros(count)
    while len(paths):
        arrived, onward = _step(scene, paths, pixel_pitch, most_events)
        ended = arrived["strength"] >= 0
        events, number = paths["events"][ended], paths["number"][ended]
        arrived, place = arrived[ended], number + count * (events > 0)
        for channel in range(3):
            light[:, channel] += np.bincount(place, arrived["light"][:, channel], 2 * count)
        cut += np.bincount(number, arrived["cut"], count)
        strength = arrived["strength"]
        np.maximum.at(strongest, place, strength)
        wins = (strength == strongest[place]) & ((strength > 0) | (events == 0))
        depths[place[wins]] = arrived["inverse_depth"][wins]
        paths = onward[onward["number"] >= 0]
    own, virtual = np.nan_to_num(depths, nan=0.0, neginf=0.0).reshape(2, count)
    own = np.maximum(own, 0)
    virtual = np.clip(virtual, 0, np.where(own > 0, NEAREST * own, np.inf))
    with np.errstate(divide="ignore"):
        first, second = np.float32(1) / own, np.float32(1) / virtual
    parts = light.astype(np.float32).reshape(2, count, 3)
    return SeenParts(parts[0], first, parts[1], second, cut.astype(np.float32))


def _step(
    scene: DeviceScene, paths: np.ndarray, pixel_pitch: float, most_events: int
) -> tuple[np.ndarray, np.ndarray]:
    """What arrives at paths (R,), ARRIVED, and the paths (2 R,) that go on, some of them none."""
    device, count = scene.device, len(paths)
    arrived, onward = page_aligned((count,), ARRIVED), page_aligned((2 * count,), PATH)
    results = {"arrived": arrived, "onward": onward}
    targets = {name: device.target_buffer(array) for name, array in results.items()}
    launch_given(
        scene, "PATHS", count, pixel_pitch, paths=device.shown(paths),
        path_numbers=record(PATH_ARGUMENTS, most_events=most_events), **targets,
    )  # fmt: skip
    for name, array in results.items():
        device.collect(targets[name], array)
    return arrived, onward
