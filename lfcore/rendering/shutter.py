"""The time dimension of the camera equation: a camera array exposed while objects move.

The shutter is cut into equal intervals and the array is traced once in the middle of each; the
mean is the exposure.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lfcore.errors import OpticsError
from lfcore.opencl.device import Device
from lfcore.optics.array import CameraArray
from lfcore.progress import Progress
from lfcore.rendering.array import trace_array
from lfcore.rendering.prepared import lit, opened
from lfcore.scene.model import Scene
from lfcore.scene.motion import scene_at
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer


def shutter_times(count: int) -> np.ndarray:
    """(count,) instants in [0, 1], the middles of intervals."""
    if count < 1:
        raise OpticsError(f"must be at least 1, not {count}", key="times")
    return (np.arange(count) + 0.5) / count


def expose(
    scene: Scene,
    times: int,
    picture: Callable[[Tracer, int], np.ndarray],
    *,
    device: Device | None = None,
    progress: Progress | None = None,
) -> np.ndarray:
    """The mean over the open shutter of ``picture(tracer, instant's number)``, float32.

    Every instant at which something moves has a hierarchy of its own.  Light is baked once, of the
    first poses.
    """
    instants, tracer = shutter_times(times), None
    device = opened(device)
    scene = lit(scene, device)
    total: np.ndarray = np.zeros(())
    view = scene.view
    moves = scene.motions and not (view and view.shutter[0] == view.shutter[1])
    for index, instant in enumerate(instants):
        if moves or tracer is None:
            motion = view.motion_time(float(instant)) if view else float(instant)
            still = scene_at(scene, motion)
            tracer = Tracer(still, build_bvh(still.triangles), device)
        total = total + picture(tracer, index).astype(np.float64)
        if progress is not None:
            progress(index + 1, len(instants))
    return (total / len(instants)).astype(np.float32)


def trace_shutter(
    scene: Scene,
    array: CameraArray,
    times: int,
    samples_per_pixel: int = 1,
    *,
    device: Device | None = None,
    progress: Progress | None = None,
) -> np.ndarray:
    """The mean of ``times`` traces of the moving scene: (Ny h, Nx w, 3) float32, linear; a scene at
    rest is traced once."""

    def picture(tracer: Tracer, index: int) -> np.ndarray:
        return trace_array(tracer, array, samples_per_pixel, seed=index)

    times = times if scene.motions else 1
    return expose(scene, times, picture, device=device, progress=progress)
