"""A scene on a device, the kernels built for it, and the memory of their workers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from lfcore.errors import SceneError
from lfcore.opencl.device import Device, build_program, cl
from lfcore.scene.model import Scene
from lfcore.scene.needs import Needs
from lfcore.tracing import layouts
from lfcore.tracing.bvh import Bvh
from lfcore.tracing.cut_outs import pack_cut_outs
from lfcore.tracing.header import header
from lfcore.tracing.layouts import CUT_OUTS, MOST_LEVELS, record
from lfcore.tracing.packets import PacketShape
from lfcore.tracing.surfaces import pack_surfaces

KERNEL = "tracing/kernels/entry/trace.cl"
MOST_NUMBERS = 2**31 - 1
"""The largest array that the kernels' indices, 32-bit integers, reach the end of."""


class EntryKernel:
    """The kernel ``trace_packets``, built for one sink; its parameters are in
    :mod:`lfcore.tracing.layouts`.

    Raises :class:`DeviceError` if the program cannot be built.
    """

    def __init__(self, device: Device, sink: str, defines: Mapping[str, object]):
        others = {name for of_sink in layouts.SINKS.values() for name in of_sink}
        self.device, self._unused = device, sorted(others - layouts.SINKS[sink].keys())
        # The wrapper of a kernel does not keep its program alive.
        self._program = build_program(device, [KERNEL], {**defines, "SINK": sink}, header())
        self.kernel = cl.Kernel(self._program, "trace_packets")
        self._words: dict[int, int] = {}

    def scratch(self, shadow_lights: int = 0) -> cl.Buffer:
        """Memory of all workers, of the size that the program reports for one."""
        if shadow_lights not in self._words:
            answer, buffer = np.zeros(1, np.int32), self.device.empty(4)
            ask = cl.Kernel(self._program, "scratch_words")
            ask(self.device.queue, (1,), None, np.int32(shadow_lights), buffer)
            cl.enqueue_copy(self.device.queue, answer, buffer)
            self._words[shadow_lights] = int(answer[0])
        return self.device.empty(4 * self._words[shadow_lights] * self.device.threads)

    def __call__(self, workers: int, **arguments: Any) -> None:
        """Launch so many workers; every parameter of the sink gets its argument by name."""
        wanted = layouts.PARAMETERS.keys() - self._unused
        if arguments.keys() != wanted:
            raise TypeError(f"arguments {sorted(arguments.keys() ^ wanted)}")
        arguments |= {name: layouts.unused(name) for name in self._unused}
        ordered = [arguments[name] for name in layouts.PARAMETERS]
        self.kernel(self.device.queue, (workers,), (1,), *ordered)


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
    shadow_lights : how many lights cast shadows.
    stops : above white, of the brightest ray.

    Raises
    ------
    SceneError : the hierarchy is deeper than the kernels' stacks, or larger than their indices.
    """

    def __init__(self, scene: Scene, bvh: Bvh, device: Device, needs: Needs, *, mipmaps: bool):
        if bvh.statistics().depth > MOST_LEVELS:
            raise SceneError(
                f"its hierarchy has more than {MOST_LEVELS} levels",
                remedy="Remove triangles that lie in each other",
            )
        self.device, self.stops = device, needs.stops
        s = pack_surfaces(scene, needs, mipmaps=mipmaps)
        self._defines, self.shadow_lights = s.defines, s.shadow_lights
        arrays = {**vars(bvh), **vars(pack_cut_outs(scene, needs)), **vars(s)}
        numbers = record(
            layouts.SCENE_ARGUMENTS, ambient=s.ambient, background=s.background,
            unshadowed_lights=len(s.lights) - s.shadow_lights, shadow_lights=s.shadow_lights,
            sky_side=len(s.sky),
        )  # fmt: skip
        shared = [name for name in (layouts.TREE | layouts.SURFACES) if name in arrays]
        check_indices(arrays[name] for name in shared)
        self.arguments: dict[str, Any] = {name: device.buffer(arrays[name]) for name in shared}
        self.arguments["scene_numbers"] = numbers
        self._kernels: dict[tuple, EntryKernel] = {}

    def kernel(self, sink: str, shape: PacketShape, defines: Mapping[str, int]) -> EntryKernel:
        """The kernel for a sink and packets of ``shape``."""
        scene = dict(self._defines)
        if sink in ("HITS", "GIVEN"):  # these know no surfaces, but whether triangles have holes
            scene = dict.fromkeys(scene, 0) | {"TEXTURES": scene["TEXTURES"] & CUT_OUTS}
        values = {
            "BITS": 0,
            "PLANES": 0,
            "STOPS": 0,
            "PEAK": 0,
            **shape.defines,
            **scene,
            **defines,
        }
        key = (sink, *sorted(values.items()))
        if key not in self._kernels:
            self._kernels[key] = EntryKernel(self.device, sink, values)
        return self._kernels[key]
