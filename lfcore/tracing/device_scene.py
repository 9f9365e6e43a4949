"""A scene on a device: buffers, made once, that all jobs share."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from lfcore.errors import SceneError
from lfcore.opencl.device import Device
from lfcore.opencl.interface import record
from lfcore.scene.model import Scene
from lfcore.scene.needs import Needs
from lfcore.tracing import layouts
from lfcore.tracing.alpha_test import pack_alpha_tests
from lfcore.tracing.bvh import Bvh, depths
from lfcore.tracing.layouts import MOST_LEVELS
from lfcore.tracing.surfaces import pack_surfaces

UNMOVED = {"textures": ("levels", "texels"), "light": ("grids", "light")}
"""The attributes of a scene that stay while it moves, and their buffers."""
MOST_NUMBERS = 2**31 - 1
"""The most numbers per array: kernels index by 32-bit integers."""


def check_indices(arrays: Iterable[np.ndarray]) -> None:
    """Raise :class:`SceneError` for an array larger than :data:`MOST_NUMBERS`."""
    largest = max(array.size for array in arrays)
    if largest > MOST_NUMBERS:
        raise SceneError(
            f"is too large: {largest} numbers in one array, of {MOST_NUMBERS} at most",
            remedy="Simplify its meshes (about 200 million triangles fit) or shrink its textures",
        )


class DeviceScene:
    """Buffers of a scene and its hierarchy.

    Attributes
    ----------
    arguments : of kernels, by name: TREE and SURFACES of :mod:`lfcore.tracing.layouts`.
    defines : the macros of programs.
    kernels : the built kernels, by sink and defines.
    triangle_count : the number of triangles.
    has_alpha : whether the alpha of a texture cuts holes, or makes surfaces transparent.
    shadow_lights : the number of lights that cast shadows.

    Raises
    ------
    SceneError : the hierarchy is deeper than the kernels' stacks, or larger than their indices.
    """

    def __init__(
        self, scene: Scene, bvh: Bvh, device: Device, needs: Needs, *, mipmaps: bool,
        before: DeviceScene | None = None,
    ):  # fmt: skip
        if len(depths(bvh)) > MOST_LEVELS:
            raise SceneError(
                f"its hierarchy has more than {MOST_LEVELS} levels",
                remedy="Remove overlapping triangles",
            )
        self.device, self.triangle_count = device, scene.triangle_count
        self._kind = device, needs, mipmaps
        self._packed = {name: getattr(scene, name) for name in UNMOVED}
        kept: dict[str, Any] = {}
        if before and before._kind == self._kind:
            for name, buffers in UNMOVED.items():
                if self._packed[name] is before._packed[name]:
                    kept |= {buffer: before.arguments[buffer] for buffer in buffers}
        s = pack_surfaces(scene, needs, mipmaps=mipmaps, left_out=kept)
        self.defines, self.shadow_lights = s.defines, s.shadow_lights
        alphas = pack_alpha_tests(scene, needs)
        self.has_alpha = len(alphas["alpha_tests"]) > 0
        arrays = {**vars(bvh), **alphas, **vars(s)}
        numbers = record(
            layouts.SCENE_ARGUMENTS, ambient=scene.ambient, background=scene.background,
            unshadowed_lights=len(s.lights) - s.shadow_lights, shadow_lights=s.shadow_lights,
            sky_side=len(scene.sky), clear_low=s.clear_box[0], clear_high=s.clear_box[1],
        )  # fmt: skip
        named = (layouts.TREE | layouts.SURFACES).keys() - kept
        shared = [name for name in arrays if name in named]
        check_indices(arrays[name] for name in shared)
        self.arguments: dict[str, Any] = {name: device.buffer(arrays[name]) for name in shared}
        self.arguments |= kept
        self.arguments["scene_numbers"] = numbers
        self.kernels: dict[tuple, Any] = {}
