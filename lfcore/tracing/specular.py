"""Specular rays: what mirrors, glass, coats and veils show, and where it appears.

A path is a ray from the lens that surfaces reflect or let pass (``kernels/paths/``).  A ray's *own*
part is the light of its first surface, its *specular* part all that this surface shows.
"""

from typing import NamedTuple

import numpy as np

from lfcore.opencl.device import page_aligned
from lfcore.opencl.interface import record
from lfcore.scene.model import Scene
from lfcore.scene.needs import is_specular
from lfcore.tracing.device_scene import DeviceScene
from lfcore.tracing.job import launch_given
from lfcore.tracing.layouts import PATH_ARGUMENTS, SEEN

MOST_EVENTS = 8
"""The most reflections and transmissions of a path."""
BLACK = 1e-3
"""The most own light, of white, of a surface that counts as black: what a codec makes of none, and
the rim of a highlight."""


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

    def placed(self) -> "SeenParts":
        """Let specular light take the place of own light where this is at most :data:`BLACK`."""
        dark = (self.specular_depth > 0) & (self.own <= BLACK).all(-1)
        depth = np.where(dark, np.float32(0), self.specular_depth)
        return SeenParts(
            np.where(dark[..., None], self.own + self.specular, self.own),
            np.where(dark, self.specular_depth, self.own_depth),
            np.where(dark[..., None], np.float32(0), self.specular),
            depth,
            self.cut,
        )


def specular_triangles(scene: Scene) -> np.ndarray:
    """The mask (T,) of triangles from which rays go on."""
    goes_on = np.array([is_specular(scene, material) for material in scene.every_material], bool)
    return goes_on[scene.material_ids]


def follow(
    scene: DeviceScene,
    origins: np.ndarray,
    directions: np.ndarray,
    pixel_pitch: float,
    triangle: np.ndarray | None = None,
    most_events: int = MOST_EVENTS,
    pitches: tuple[float, float, int] = (0.0, 0.0, 1),
) -> SeenParts:
    """Follow rays (R, 3) from the lens, whose directions have z = 1; textures are filtered over the
    tangent ``pixel_pitch``.  ``triangle`` (R,) int32 are those that the rays hit, if known; the own
    light of these is then left out.  ``pitches`` are as of :class:`Bundles`."""
    device, seen = scene.device, page_aligned((len(origins),), SEEN)
    if len(seen):
        target = device.target_buffer(seen)
        launch_given(
            scene, "PATHS", len(seen), pixel_pitch, seen=target,
            path_numbers=record(
                PATH_ARGUMENTS, most_events=most_events, lens_pitch=pitches[0],
                pixel_pitch=pitches[1], lens_bits=min(3, pitches[2].bit_length() - 1),
            ),
            origins=device.shared(np.ascontiguousarray(origins)),
            directions=device.shared(np.ascontiguousarray(directions)),
            triangle=None if triangle is None else device.shared(triangle),
        )  # fmt: skip
        device.collect(target, seen)
    return SeenParts(*(seen[name] for name in SeenParts._fields))
