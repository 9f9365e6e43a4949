"""A scene on a device: buffers, made once, that all jobs share."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from typing import Any

import numpy as np

from lfcore.errors import SceneError
from lfcore.opencl.device import Device, cl
from lfcore.opencl.interface import record
from lfcore.scene.model import Scene
from lfcore.scene.needs import Needs
from lfcore.tracing.alpha_test import pack_alpha_tests
from lfcore.tracing.bvh import Bvh, depths
from lfcore.tracing.layouts import LINE, MOST_LEVELS, SCENE_ARGUMENTS, SCENE_ARRAYS
from lfcore.tracing.surfaces import pack_surfaces

UNMOVED = {"textures": ("mip_levels", "texels"), "light": ("grids", "baked_light")}
"""The attributes of a scene that stay while it moves, and their arrays on the device."""
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


class _Joined:
    """Arrays in one buffer of a device, each from a line of its own on: SCENE_ARRAYS.

    Those of ``kept`` are copied from the buffer of a scene ``before``.
    """

    def __init__(
        self, arrays: Mapping[str, np.ndarray], device: Device, kept: Collection[str],
        before: _Joined | None,
    ):  # fmt: skip
        self.bytes = {name: arrays[name].nbytes for name in SCENE_ARRAYS}
        if before:
            self.bytes |= {name: before.bytes[name] for name in kept}
        lines = [max(1, -(-size // LINE)) for size in self.bytes.values()]
        ends = np.cumsum([0, *lines]).tolist()
        self.starts = dict(zip(SCENE_ARRAYS, ends[:-1], strict=True))
        self.buffer = device.zeros(LINE * ends[-1])
        for name, size in self.bytes.items():
            source: Any = {"src": np.ascontiguousarray(arrays[name])}
            if before and name in kept:
                first = LINE * before.starts[name]
                source = {"src": before.buffer, "src_offset": first, "byte_count": size}
            if size:
                first = LINE * self.starts[name]
                cl.enqueue_copy(device.queue, self.buffer, **source, dst_offset=first)


class DeviceScene:
    """Buffers of a scene and its hierarchy.

    Attributes
    ----------
    arguments : of kernels, by name: the scene's arrays and numbers.
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
        kept: list[str] = []
        if before and before._kind == self._kind:
            for name, arrays in UNMOVED.items():
                if self._packed[name] is before._packed[name]:
                    kept += arrays
        s = pack_surfaces(scene, needs, mipmaps=mipmaps, left_out=kept)
        self.defines, self.shadow_lights = s.defines, s.shadow_lights
        alphas = pack_alpha_tests(scene, needs)
        self.has_alpha = len(alphas["alpha_tests"]) > 0
        packed = {**vars(bvh), **alphas, **vars(s)}
        check_indices(packed[name] for name in SCENE_ARRAYS)
        self._joined: _Joined = _Joined(packed, device, kept, before._joined if before else None)
        numbers = record(
            SCENE_ARGUMENTS, starts=tuple(self._joined.starts.values()),
            ambient=scene.ambient, background=scene.background,
            unshadowed_lights=len(s.lights) - s.shadow_lights, shadow_lights=s.shadow_lights,
            curved=needs.curved and needs.smooth_normals, sky_side=len(scene.sky),
            clear_low=s.clear_box[0], clear_high=s.clear_box[1],
        )  # fmt: skip
        self.arguments: dict[str, Any] = {"scene": self._joined.buffer, "scene_numbers": numbers}
        self.kernels: dict[tuple, Any] = {}
