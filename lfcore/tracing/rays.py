"""What arbitrary rays meet first."""

from __future__ import annotations

import numpy as np

from lfcore.opencl.host_memory import collect, page_aligned, target_buffer
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
        triangle, distance = page_aligned((count,), np.int32), page_aligned((count,))
        barycentric = page_aligned((count, 3))
        outputs = triangle, distance, barycentric
        if not count:
            return outputs
        buffers = [target_buffer(device, a) for a in outputs]
        self.kernel(
            scene.workers(count),
            **scene.tree,
            origins=device.buffer(origins),
            directions=device.buffer(directions),
            ray_count=np.int32(count),
            next=scene.counter(),
            triangle=buffers[0],
            distance=buffers[1],
            weights=buffers[2],
        )
        for array, buffer in zip(outputs, buffers, strict=True):
            collect(device, buffer, array)
        return outputs
