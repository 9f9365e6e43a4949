"""Visibility alone: the closest triangle and depth of every ray of bundles."""

from __future__ import annotations

import numpy as np

from lfcore.opencl.device import cl
from lfcore.opencl.host_memory import collect, page_aligned, target_buffer
from lfcore.optics.bundles import Bundles
from lfcore.tracing.device_scene import DeviceScene
from lfcore.tracing.packets import Groups, PacketShape

CHUNK_RAYS = 1 << 24
"""Rays whose hits a device with memory of its own holds at a time."""


class SlabHits:
    """Launches of ``slab_hits`` (entry/hits.cl) for packets of one shape.

    Call it with bundles and, if their elements share packets, the elements' places: it returns
    triangles (E, rows, columns) int32, -1 for a miss, and depths float32, infinity for a miss.
    """

    def __init__(self, scene: DeviceScene, shape: PacketShape):
        self.scene, self.shape = scene, shape
        self.kernel = scene.kernel("hits.cl", "slab_hits", shape)

    def __call__(
        self, bundles: Bundles, coordinates: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        count, per_element = len(bundles.elements), bundles.columns * bundles.rows
        device, shape = self.scene.device, (count, bundles.rows, bundles.columns)
        depth, triangle = page_aligned(shape), page_aligned(shape, np.int32)
        step = max(1, count if device.is_cpu else CHUNK_RAYS // per_element)
        for start in range(0, count, step):
            part = slice(start, min(start + step, count))
            places = None if coordinates is None else np.asarray(coordinates)[part]
            outputs = target_buffer(device, depth[part]), target_buffer(device, triangle[part])
            self.launch(bundles.part(part), places, outputs)
            for target, host in zip(outputs, (depth, triangle), strict=True):
                collect(device, target, host[part])
        return triangle, depth

    def launch(
        self,
        bundles: Bundles,
        coordinates: np.ndarray | None,
        outputs: tuple[cl.Buffer, cl.Buffer],
    ) -> None:
        """Write depths and triangles, 4 bytes a ray, to ``outputs`` before the queue is done."""
        scene = self.scene
        groups = Groups.of(self.shape, bundles, coordinates)
        self.kernel(
            scene.workers(len(groups.members)),
            **scene.tree,
            **scene.rays(bundles, groups, self.shape, self.kernel.scratch()),
            depth=outputs[0],
            triangle=outputs[1],
        )
