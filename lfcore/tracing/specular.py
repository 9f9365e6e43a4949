"""Specular rays: what mirrors, glass, coats and veils show, and where it appears.

A path is a ray from the lens that surfaces reflect or let pass.  The kernel takes paths one surface
further at a time (``kernels/paths/``); what arrives from them is added here.  A ray's *own* part
is the light of its first surface, its *specular* part all that this surface shows.
"""

from typing import NamedTuple

import numpy as np

from lfcore.opencl.device import cl, page_aligned
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
BATCH = 1 << 15
"""Rays whose paths are followed together, in 15 MB."""


class SeenParts(NamedTuple):
    """What R rays see.

    Attributes
    ----------
    own, specular : (R, 3) float32
        Linear RGB radiance of both parts.
    own_depth, specular_depth : (R,) float32
        Depths at which they appear, metres; infinity for what is far.  ``specular_depth`` is 0
        where no light arrives.
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
    paths = _Paths(scene, pixel_pitch, most_events)
    batches = [
        paths.follow(origins[first : first + BATCH], directions[first : first + BATCH])
        for first in range(0, max(len(origins), 1), BATCH)
    ]
    return SeenParts(*(np.concatenate(parts) for parts in zip(*batches, strict=True)))


class _Seen:
    """Sums of what arrives at R rays: light of both parts, depths, and what chose these."""

    def __init__(self, count: int):
        self.count, self.cut = count, np.zeros(count)
        self.light = np.zeros((3, 2 * count))
        self.depths, self.strongest = np.zeros((2, 2 * count), np.float32)

    def add(self, arrived: np.ndarray, number: np.ndarray, events: np.ndarray) -> None:
        """Add ARRIVED (K,) of paths of rays ``number`` (K,) after so many events (K,)."""
        ended = np.flatnonzero(arrived["strength"] >= 0)
        arrived, number, is_first = arrived[ended], number[ended], events[ended] == 0
        place = np.where(is_first, number, number + self.count)
        for channel in range(3):
            values = arrived["light"][:, channel]
            self.light[channel] += np.bincount(place, values, 2 * self.count)
        self.cut += np.bincount(number, arrived["cut"], self.count)
        strength = arrived["strength"]
        np.maximum.at(self.strongest, place, strength)
        wins = (strength == self.strongest[place]) & ((strength > 0) | is_first)
        self.depths[place[wins]] = arrived["inverse_depth"][wins]

    def parts(self) -> SeenParts:
        count = self.count
        own, virtual = np.nan_to_num(self.depths, nan=0.0, neginf=0.0).reshape(2, count)
        own = np.maximum(own, 0)
        virtual = np.clip(virtual, 0, np.where(own > 0, NEAREST * own, np.inf))
        with np.errstate(divide="ignore"):
            first, second = np.float32(1) / own, np.float32(1) / virtual
        second[self.strongest[count:] <= 0] = 0
        light = self.light.astype(np.float32).T
        return SeenParts(light[:count], first, light[count:], second, self.cut.astype(np.float32))


class _Paths:
    """Paths on a device."""

    def __init__(self, scene: DeviceScene, pixel_pitch: float, most_events: int):
        self._scene, self._pitch, self._most_events = scene, pixel_pitch, most_events
        self._rooms = [np.zeros(0, PATH)] * 2

    def _room(self, count: int) -> np.ndarray:
        """Memory of ``count`` paths, which stays until the second next call: new memory is slow."""
        self._rooms.reverse()
        if len(self._rooms[0]) < count:
            self._rooms[0] = page_aligned((count,), PATH)
        return self._rooms[0][:count]

    def follow(self, origins: np.ndarray, directions: np.ndarray) -> SeenParts:
        """Follow rays (R, 3) to the end."""
        count, device = len(origins), self._scene.device
        seen = _Seen(count)
        if not count:
            return seen.parts()
        begun = {
            "origins": device.shared(np.ascontiguousarray(origins)),
            "directions": device.shared(np.ascontiguousarray(directions)),
        }
        paths = device.target_buffer(self._room(count))
        arrived, onward, paths = self._step(count, paths, **begun)
        seen.add(arrived, np.arange(count), np.zeros(count, np.int32))
        while len(chosen := np.flatnonzero(onward["number"] >= 0).astype(np.int32)):
            number, events = onward["number"][chosen], onward["events"][chosen]
            arrived, onward, paths = self._step(len(chosen), paths, chosen=device.buffer(chosen))
            seen.add(arrived, number, events)
        return seen.parts()

    def _step(
        self, count: int, paths: cl.Buffer, **given: cl.Buffer
    ) -> tuple[np.ndarray, np.ndarray, cl.Buffer]:
        """Take ``count`` paths one surface further: the ``chosen`` ones, or those of given rays.

        Returns what arrives, ARRIVED (R,), and PATH (2 R,), those that go on and places of none,
        with their buffer.
        """
        device = self._scene.device
        arrived, onward = page_aligned((count,), ARRIVED), self._room(2 * count)
        targets = {"arrived": device.target_buffer(arrived), "onward": device.target_buffer(onward)}
        numbers = record(PATH_ARGUMENTS, most_events=self._most_events, begins="origins" in given)
        nothing = dict.fromkeys(("origins", "directions", "chosen"))
        launch_given(
            self._scene, "PATHS", count, self._pitch, path_numbers=numbers, paths=paths,
            **(nothing | given), **targets,
        )  # fmt: skip
        device.collect(targets["arrived"], arrived)
        device.collect(targets["onward"], onward)
        return arrived, onward, targets["onward"]
