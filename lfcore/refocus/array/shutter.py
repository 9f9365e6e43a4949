"""The time dimension of the camera equation: a camera array exposed while objects move.

The shutter is cut into equal intervals and the array is traced once in the middle of each, or at
one random instant of each; the mean is the exposure.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lfcore.errors import OpticsError
from lfcore.opencl.device import Device
from lfcore.optics.array import CameraArray
from lfcore.refocus.array.trace import trace_array
from lfcore.scene.model import Scene
from lfcore.scene.motion import scene_at
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer


def shutter_times(count: int, seed: int | None = None) -> np.ndarray:
    """(count,) instants in [0, 1], one in each interval: the middle, or random with a seed.

    Raises :class:`OpticsError` for none.
    """
    if count < 1:
        raise OpticsError(f"must be at least 1, not {count}", key="times")
    jitter = 0.5 if seed is None else np.random.default_rng(seed).random(count)
    return (np.arange(count) + jitter) / count


def trace_shutter(
    scene: Scene,
    array: CameraArray,
    times: int,
    samples_per_pixel: int = 1,
    *,
    seed: int | None = None,
    device: Device | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> np.ndarray:
    """The mean of ``times`` traces of the moving scene: (Ny h, Nx w, 3) float32, linear.

    A scene at rest is traced once.  Every instant has a hierarchy of its own, so the cost is
    that of ``times`` arrays and builds.  ``progress`` is called with (instants done, instants).
    """
    instants = shutter_times(times if scene.motions else 1, seed)
    total = np.zeros((*array.image_size[::-1], 3), np.float64)
    for index, time in enumerate(instants):
        still = scene_at(scene, float(time))
        tracer = Tracer(still, build_bvh(still.triangles), device)
        total += trace_array(tracer, array, samples_per_pixel, seed=index)
        if progress is not None:
            progress(index + 1, len(instants))
    return (total / len(instants)).astype(np.float32)
