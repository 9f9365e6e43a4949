"""One job: rays of any source, packet by packet, into one sink."""

from typing import Any

import numpy as np

from lfcore.opencl.device import cl
from lfcore.optics.bundles import Bundles
from lfcore.tracing.device_scene import DeviceScene
from lfcore.tracing.layouts import RAY_ARGUMENTS, record
from lfcore.tracing.packets import Groups, PacketShape


class PacketJob:
    """Launches of the kernel ``trace_packets`` for packets of one shape.

    Parameters
    ----------
    sink : of :data:`lfcore.tracing.layouts.SINKS`.
    defines : what its program is built with beside the scene's and the shape's defines.

    Attributes
    ----------
    scratch : the memory of the device's workers.
    """

    def __init__(self, scene: DeviceScene, shape: PacketShape, sink: str, **defines: int):
        self.scene, self.shape, self.sink = scene, shape, sink
        self.kernel = scene.kernel(sink, shape, defines)
        self.scratch: cl.Buffer = self.kernel.scratch(scene.shadow_lights)

    def launch(
        self, bundles: Bundles, groups: Groups, workers: int | None = None, **sink: Any
    ) -> None:
        """Trace ``groups`` of bundles into the sink's arguments before the queue is done."""
        device, shape = self.scene.device, self.shape
        lattice = bundles.lattice if shape.outer > 1 else None
        packets = len(groups.members) * shape.packets_per_group(bundles.columns, bundles.rows)
        numbers = record(
            RAY_ARGUMENTS,
            step=bundles.step,
            outer=(lattice.origin, lattice.direction) if lattice else 0,
            columns=bundles.columns,
            rows=bundles.rows,
            packets=packets,
            strip_height=groups.strip_height,
            pixel_tangent=bundles.pixel_pitch,
            half_extent=shape.half_extent,
            group=shape.group,
            side=shape.side,
        )
        self.kernel(
            max(1, min(workers or device.threads, packets // groups.strip_height)),
            **self.scene.arguments,
            elements=device.buffer(np.ascontiguousarray(groups.centre_rays)),
            groups=device.buffer(groups.members),
            ray_numbers=numbers,
            next=device.buffer(np.zeros(1, np.int32)),
            scratch=self.scratch,
            **sink,
        )
