"""What arbitrary rays meet first."""

from __future__ import annotations

import numpy as np

from lfcore.opencl.device import cl
from lfcore.tracing.device_scene import DeviceScene, EntryKernel


class ClosestHits:
    """Launches of ``closest_hits`` (entry/rays.cl); see :meth:`Tracer.closest_hit`."""

    def __init__(self, scene: DeviceScene):
        self.scene = scene
        defines = {"OUTER": 1, **scene.visibility}
        self.kernel = EntryKernel(scene.device, "rays.cl", "closest_hits", defines)

    def __call__(
        self, origins: np.ndarray, directions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        scene, device, count = self.scene, self.scene.device, len(origins)
        triangle, distance = np.empty(count, np.int32), np.empty(count, np.float32)
        barycentric = np.empty((count, 3), np.float32)
        outputs = triangle, distance, barycentric
        if not count:
            return outputs
        buffers = [device.empty(a.nbytes) for a in outputs]
        self.kernel(
            scene.workers(count),
            *scene.tree,
            device.buffer(origins),
            device.buffer(directions),
            np.int32(count),
            scene.counter(),
            *buffers,
        )
        for array, buffer in zip(outputs, buffers, strict=True):
            cl.enqueue_copy(device.queue, array, buffer)
        return outputs
