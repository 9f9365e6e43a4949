"""A scene on a device, the kernels built for it, and the memory of their workers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from lfcore.errors import DeviceError, SceneError
from lfcore.opencl.device import Device, build_program, cl
from lfcore.optics.bundles import Bundles
from lfcore.scene.model import Scene
from lfcore.scene.needs import Needs
from lfcore.tracing.bvh import Bvh
from lfcore.tracing.cut_outs import pack_cut_outs
from lfcore.tracing.packets import Groups, PacketShape
from lfcore.tracing.surfaces import CUT_OUTS, pack_surfaces

FOLDER = "tracing/kernels/entry"
MOST_LEVELS = 64
"""Levels of a hierarchy that the kernels' stacks hold, as in traversal/walk.cl."""
MOST_NUMBERS = 2**31 - 1
"""The largest array that the kernels' indices, 32-bit integers, reach the end of."""

# Structs of the kernels.  Every member is four bytes, so there is no padding.
RAY_ARGUMENTS = np.dtype(
    [("step", np.float32, 4), ("outer", np.float32, 2)]
    + [(name, np.int32) for name in ("columns", "rows", "packets")]
    + [("pixel_tangent", np.float32), ("extent", np.float32)]
    + [("group", np.int32), ("side", np.int32)]
)
SCENE_ARGUMENTS = np.dtype(
    [("ambient", np.float32, 3), ("background", np.float32, 3)]
    + [(name, np.int32) for name in ("open_lights", "shadow_lights")]
)


class EntryKernel:
    """A kernel of ``entry/``, whose structs have the layouts that the host fills.

    Parameters
    ----------
    file, name : in ``entry/``, and of the kernel.
    defines : what the program is built with.
    structs : layouts of the kernel's structs, in the order of its ``struct_sizes``.

    Raises
    ------
    DeviceError : it does not build, or the device lays a struct out in another way.
    """

    def __init__(
        self,
        device: Device,
        file: str,
        name: str,
        defines: Mapping[str, object],
        structs: tuple[np.dtype, ...] = (),
    ):
        self.device = device
        # The wrapper of a kernel does not keep its program alive.
        self._program = build_program(device, [f"{FOLDER}/{file}"], defines)
        self.kernel = cl.Kernel(self._program, name)
        self._words: dict[int, int] = {}
        if not structs:
            return
        sizes = self._ask("struct_sizes", count=len(structs))
        if sizes.tolist() != [struct.itemsize for struct in structs]:
            raise DeviceError(f"{device.name} lays out the arguments of {name} in its own way")

    def _ask(self, name: str, *arguments: Any, count: int) -> np.ndarray:
        answer, buffer = np.zeros(count, np.int32), self.device.empty(4 * count)
        cl.Kernel(self._program, name)(self.device.queue, (1,), None, *arguments, buffer)
        cl.enqueue_copy(self.device.queue, answer, buffer)
        return answer

    def scratch(self, shadow_lights: int = 0) -> cl.Buffer:
        """Memory of all workers, of the size that the program says one needs."""
        if shadow_lights not in self._words:
            words = self._ask("scratch_words", np.int32(shadow_lights), count=1)
            self._words[shadow_lights] = int(words[0])
        return self.device.empty(4 * self._words[shadow_lights] * self.device.threads)

    def __call__(self, workers: int, *arguments: Any) -> None:
        """Launch so many workers."""
        self.kernel(self.device.queue, (workers,), (1,), *arguments)


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
    tree, surfaces : the kernels' first arguments.
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
        tree = (bvh.boxes, bvh.children, bvh.leaves, bvh.leaf_ids)
        tree = (*tree, *vars(pack_cut_outs(scene, needs)).values())
        arrays = (s.corners, s.attributes, s.material_ids, s.materials, s.lights, s.images)
        check_indices([*tree, *arrays, s.texels])
        buffer = device.buffer
        self.tree = [buffer(a) for a in tree]
        numbers = np.zeros((), SCENE_ARGUMENTS)
        numbers["ambient"], numbers["background"] = s.ambient, s.background
        numbers["open_lights"] = len(s.lights) - s.shadow_lights
        numbers["shadow_lights"] = s.shadow_lights
        self.surfaces = [*(buffer(a) for a in (*arrays, s.texels)), numbers]
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
        structs: tuple[np.dtype, ...],
        defines: Mapping[str, object] | None = None,
    ) -> EntryKernel:
        """A kernel for packets of ``shape``; with ``defines`` it knows surfaces, too."""
        known = self.visibility if defines is None else {**self._defines, **defines}
        values = {**shape.defines, **known}
        key = (file, name, *sorted(values.items()))
        if key not in self._kernels:
            self._kernels[key] = EntryKernel(self.device, file, name, values, structs)
        return self._kernels[key]

    def rays(self, bundles: Bundles, groups: Groups, shape: PacketShape) -> list:
        """The kernels' arguments that say which rays: elements, groups and a struct."""
        lattice = bundles.lattice if shape.outer > 1 else None
        numbers = np.zeros((), RAY_ARGUMENTS)
        numbers["step"] = bundles.step
        numbers["outer"] = (lattice.origin, lattice.direction) if lattice else 0
        numbers["columns"], numbers["rows"] = bundles.columns, bundles.rows
        numbers["packets"] = len(groups.members) * shape.squares(bundles.columns, bundles.rows)
        numbers["pixel_tangent"] = bundles.pixel_pitch
        numbers["extent"], numbers["group"], numbers["side"] = shape.extent, shape.group, shape.side
        middles = np.ascontiguousarray(groups.middles)
        return [self.device.buffer(middles), self.device.buffer(groups.members), numbers]

    def counter(self) -> cl.Buffer:
        """What workers take the next packet from."""
        return self.device.buffer(np.zeros(1, np.int32))

    def workers(self, groups: int) -> int:
        """How many work on so many groups of elements."""
        return max(1, min(self.device.threads, groups * 64))
