"""Visibility alone: the closest triangle and depth of every ray of bundles."""

from __future__ import annotations

import numpy as np

from lfcore.opencl.device import cl
from lfcore.optics.bundles import Bundles
from lfcore.tracing.device_scene import RAY_ARGUMENTS, DeviceScene
from lfcore.tracing.packets import Groups, PacketShape

CHUNK_RAYS = 1 << 24
"""Rays whose hits a device holds at a time."""


class SlabHits:
    """Launches of ``slab_hits`` (entry/hits.cl) for packets of one shape.

    Call it with bundles and, if their elements share packets, the elements' places: it returns
    triangles (E, rows, columns) int32, -1 for a miss, and depths float32, infinity for a miss.
    """

    def __init__(self, scene: DeviceScene, shape: PacketShape):
        self.scene, self.shape = scene, shape
        self.kernel = scene.kernel("hits.cl", "slab_hits", shape, (RAY_ARGUMENTS,))

    def __call__(
        self, bundles: Bundles, coordinates: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        count, per_element = len(bundles.elements), bundles.columns * bundles.rows
        triangle = np.empty((count, bundles.rows, bundles.columns), np.int32)
        depth = np.empty(triangle.shape, np.float32)
        step = max(1, CHUNK_RAYS // per_element)
        for start in range(0, count, step):
            part = slice(start, min(start + step, count))
            places = None if coordinates is None else np.asarray(coordinates)[part]
            depths, triangles = self.launch(bundles.part(part), places)
            cl.enqueue_copy(self.scene.device.queue, depth[part], depths)
            cl.enqueue_copy(self.scene.device.queue, triangle[part], triangles)
        return triangle, depth

    def launch(
        self, bundles: Bundles, coordinates: np.ndarray | None
    ) -> tuple[cl.Buffer, cl.Buffer]:
        """Device buffers of depths and triangles, which are there once the queue is done."""
        scene, device = self.scene, self.scene.device
        groups = Groups.of(self.shape, bundles, coordinates)
        size = 4 * len(bundles.elements) * bundles.columns * bundles.rows
        outputs = device.empty(size), device.empty(size)
        self.kernel(
            scene.workers(len(groups.members)),
            *scene.tree,
            *scene.rays(bundles, groups, self.shape),
            scene.counter(),
            self.kernel.scratch(),
            *outputs,
        )
        return outputs
