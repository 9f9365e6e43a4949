"""A scene on a device, the kernels built for it, and the memory of their workers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from lfcore.errors import SceneError
from lfcore.opencl.device import Device, build_program, cl
from lfcore.optics.bundles import Bundles
from lfcore.scene.model import Scene
from lfcore.scene.needs import Needs
from lfcore.tracing import layouts
from lfcore.tracing.bvh import Bvh
from lfcore.tracing.cut_outs import pack_cut_outs
from lfcore.tracing.layouts import CUT_OUTS, MOST_LEVELS, record
from lfcore.tracing.packets import Groups, PacketShape
from lfcore.tracing.surfaces import pack_surfaces

FOLDER = "tracing/kernels/entry"
MOST_NUMBERS = 2**31 - 1
"""The largest array that the kernels' indices, 32-bit integers, reach the end of."""


class EntryKernel:
    """A kernel of ``entry/``; its parameters are those of :data:`lfcore.tracing.layouts.KERNELS`.

    Parameters
    ----------
    file, name : in ``entry/``, and of the kernel.
    defines : the program is built with these.

    Raises
    ------
    DeviceError : the program cannot be built.
    """

    def __init__(self, device: Device, file: str, name: str, defines: Mapping[str, object]):
        self.device, self.parameters = device, layouts.KERNELS[name]
        # The wrapper of a kernel does not keep its program alive.
        self._program = build_program(device, [f"{FOLDER}/{file}"], defines, layouts.header())
        self.kernel = cl.Kernel(self._program, name)
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
        """Launch so many workers; every parameter gets its argument by name."""
        if arguments.keys() != self.parameters.keys():
            raise TypeError(f"arguments {sorted(arguments.keys() ^ self.parameters.keys())}")
        ordered = [arguments[name] for name in self.parameters]
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
    tree, surfaces : arguments of kernels, by name.
    shadow_lights : how many lights cast shadows.

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
        self.device = device
        s = pack_surfaces(scene, needs, mipmaps=mipmaps)
        self._defines, self.shadow_lights = s.defines, s.shadow_lights
        arrays = {**vars(bvh), **vars(pack_cut_outs(scene, needs)), **vars(s)}
        numbers = record(
            layouts.SCENE_ARGUMENTS, ambient=s.ambient, background=s.background,
            unshadowed_lights=len(s.lights) - s.shadow_lights, shadow_lights=s.shadow_lights,
        )  # fmt: skip
        shared = [name for name in (layouts.TREE | layouts.SURFACES) if name in arrays]
        check_indices(arrays[name] for name in shared)
        buffers: dict[str, Any] = {name: device.buffer(arrays[name]) for name in shared}
        buffers["scene_numbers"] = numbers
        self.tree = {name: buffers[name] for name in layouts.TREE}
        self.surfaces = {name: buffers[name] for name in layouts.SURFACES}
        self._kernels: dict[tuple, EntryKernel] = {}

    @property
    def visibility(self) -> dict[str, int]:
        """Defines of what knows no surfaces: whether triangles have holes."""
        return {"TEXTURES": self._defines["TEXTURES"] & CUT_OUTS}

    def kernel(
        self,
        file: str,
        name: str,
        shape: PacketShape,
        defines: Mapping[str, object] | None = None,
    ) -> EntryKernel:
        """A kernel for packets of ``shape``; with ``defines`` it knows surfaces, too."""
        known = self.visibility if defines is None else {**self._defines, **defines}
        values = {**shape.defines, **known}
        key = (file, name, *sorted(values.items()))
        if key not in self._kernels:
            self._kernels[key] = EntryKernel(self.device, file, name, values)
        return self._kernels[key]

    def rays(
        self, bundles: Bundles, groups: Groups, shape: PacketShape, scratch: cl.Buffer
    ) -> dict[str, Any]:
        """The kernels' arguments RAYS; ``scratch`` is of :meth:`EntryKernel.scratch`."""
        lattice = bundles.lattice if shape.outer > 1 else None
        numbers = record(
            layouts.RAY_ARGUMENTS,
            step=bundles.step,
            outer=(lattice.origin, lattice.direction) if lattice else 0,
            columns=bundles.columns,
            rows=bundles.rows,
            packets=len(groups.members) * shape.packets_per_group(bundles.columns, bundles.rows),
            pixel_tangent=bundles.pixel_pitch,
            half_extent=shape.half_extent,
            group=shape.group,
            side=shape.side,
        )
        return {
            "elements": self.device.buffer(np.ascontiguousarray(groups.centre_rays)),
            "groups": self.device.buffer(groups.members),
            "ray_numbers": numbers,
            "next": self.counter(),
            "scratch": scratch,
        }

    def counter(self) -> cl.Buffer:
        """The number of the next packet, which workers take from one another."""
        return self.device.buffer(np.zeros(1, np.int32))

    def workers(self, groups: int) -> int:
        """How many work on so many groups of elements."""
        return max(1, min(self.device.threads, groups * 64))
