"""Jobs: bundles packet by packet, or given rays, into one sink."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from lfcore.opencl.device import cl
from lfcore.opencl.interface import BLOCK, record
from lfcore.opencl.kernel import Kernel
from lfcore.opencl.programs import Program
from lfcore.optics.bundles import Bundles
from lfcore.scene.needs import Needs
from lfcore.tracing.device_scene import DeviceScene
from lfcore.tracing.layouts import (
    ALPHA_TESTS,
    INTERFACE,
    PHYSICAL,
    RAY_ARGUMENTS,
    SINKS,
)
from lfcore.tracing.packets import Groups, PacketShape
from lfcore.tracing.surfaces import macros_of

KERNEL = "tracing/kernels/entry/trace.cl"


class EntryKernel(Kernel):
    """The kernel of a sink, and the bytes that its workers need.

    Raises :class:`DeviceError` if the program cannot be built.
    """

    def __init__(self, scene: DeviceScene, sink: str, defines: Mapping[str, object]):
        name, unused = SINKS[sink]
        super().__init__(scene.device, [KERNEL], name, defines, INTERFACE)
        self._unused: dict[str, Any] = dict.fromkeys(unused)
        words, answer = np.zeros(1, np.int32), self.device.empty(4)
        ask = cl.Kernel(self._program, "scratch_words")
        ask(self.device.queue, (1,), None, np.int32(scene.shadow_lights), answer)
        cl.enqueue_copy(self.device.queue, words, answer)
        self.scratch_bytes = 4 * int(words[0]) * self.device.threads

    def __call__(self, *size: int, **arguments: Any) -> None:
        """Launch workers, with an argument per parameter that the sink uses."""
        super().__call__(*size, **arguments, **self._unused)


BLOCKS = PacketShape.for_inner(BLOCK).defines
"""The macros of programs for blocks of one element's rays."""
SINGLE = {"OUTER": 1, "SINGLE_RAYS": 1}
"""The macros of programs for rays that are given one by one."""


def _macros(sink: str, scene: Mapping[str, int], *, has_alpha: bool = False) -> dict[str, object]:
    """Those of the macros of a ``scene`` that matter to a sink, and the sink."""
    changes: dict[str, int] = {}
    specular = scene["SPECULAR"] * (sink == "IMAGE")
    if sink in ("HITS", "GIVEN"):  # without surfaces, but with alpha tests
        changes = dict.fromkeys(scene, 0) | {"TEXTURES": scene["TEXTURES"] & ALPHA_TESTS}
    elif sink in ("SURFACE", "GIVEN_SURFACE"):  # without lights
        changes = {"SHADOWS": 0, "BAKED": 0, "CLEAR": 0}
    elif sink == "PATHS" or specular:
        always = PHYSICAL | ALPHA_TESTS * has_alpha
        changes = {"TEXTURES": scene["TEXTURES"] | always}
    rough = scene["ROUGH"] * (sink == "PATHS")
    return {**scene, **changes, "SPECULAR": specular, "ROUGH": rough, "SINK": sink}


def _kernel_of(scene: DeviceScene, sink: str, values: Mapping[str, float]) -> EntryKernel:
    """The scene's kernel for a sink, which is built once."""
    macros = {**_macros(sink, scene.defines, has_alpha=scene.has_alpha), **values}
    key = tuple(sorted(macros.items()))
    if key not in scene.kernels:
        scene.kernels[key] = EntryKernel(scene, sink, macros)
    return scene.kernels[key]


def program_of(sink: str, needs: Needs, macros: Mapping[str, int]) -> Program:
    """The program for a sink, :data:`BLOCKS` or :data:`SINGLE`, of a scene with these needs."""
    return [KERNEL], {**_macros(sink, macros_of(needs)), **macros}, INTERFACE


def launch_given(
    scene: DeviceScene, sink: str, count: int, pixel_pitch: float = 0.0, **arguments: Any
) -> None:
    """Trace or shade ``count`` rays that are given one by one, before the queue is done.

    ``arguments`` are the sink's; ``pixel_pitch`` is the tangent over which textures are filtered.
    """
    kernel, device = _kernel_of(scene, sink, SINGLE), scene.device
    numbers = np.zeros((), RAY_ARGUMENTS)
    numbers["columns"], numbers["pixel_pitch"] = count, pixel_pitch
    numbers["packets"] = packets = -(-count // BLOCK**2)
    kernel(
        max(1, min(device.threads, packets)),
        **scene.arguments,
        ray_numbers=numbers,
        next_packet=device.buffer(np.zeros(1, np.int32)),
        scratch=device.empty(kernel.scratch_bytes),
        **arguments,
    )


class PacketJob:
    """Launches of one kernel for packets of one shape.

    Parameters
    ----------
    sink : of :data:`lfcore.tracing.layouts.SINKS`.

    Attributes
    ----------
    scratch : the memory of the device's workers.
    """

    def __init__(self, scene: DeviceScene, shape: PacketShape, sink: str):
        self.scene, self.shape, self.sink = scene, shape, sink
        self.kernel = _kernel_of(scene, sink, shape.defines)
        self.scratch: cl.Buffer = scene.device.empty(self.kernel.scratch_bytes)

    def launch(
        self, bundles: Bundles, groups: Groups, *, across: int = 1, add: bool = False, **sink: Any
    ) -> None:
        """Trace ``groups`` of bundles into the sink's arguments before the queue is done.

        ``across`` and ``add`` as in RAY_ARGUMENTS.
        """
        device, shape = self.scene.device, self.shape
        lattice = bundles.lattice if shape.outer > 1 else None
        per_group = shape.packets_per_group(bundles.columns, bundles.traced_rows)
        packets = len(groups.members) * per_group
        numbers = record(
            RAY_ARGUMENTS, step=bundles.step,
            outer=(lattice.origin, lattice.direction) if lattice else 0,
            columns=bundles.columns, rows=bundles.rows, first_row=bundles.first_row,
            end_row=bundles.first_row + bundles.traced_rows, packets=packets,
            pixel_pitch=bundles.pixel_pitch, half_extent=shape.half_extent,
            side=shape.side, across=across, add=add,
        )  # fmt: skip
        self.kernel(
            max(1, min(device.threads, packets)),
            **self.scene.arguments,
            centre_rays=device.buffer(np.ascontiguousarray(groups.centre_rays)),
            members=device.buffer(groups.members),
            ray_numbers=numbers,
            next_packet=device.buffer(np.zeros(1, np.int32)),
            scratch=self.scratch,
            **sink,
        )
