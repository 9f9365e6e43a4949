"""The least that is traced: two triangles, no texture, no file; imports what a job imports."""

from __future__ import annotations

import numpy as np

from lfcore.evaluation.stability.tested_tracer import CAMERA, bare_scene
from lfcore.opencl.device import open_device
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.rendering.direct import tile_sums
from lfcore.storage.layout import FrameLayout
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer

TRIANGLES = [[[-1, -1, 2], [1, -1, 2.5], [0, 1, 2]], [[-2, -2, 4], [2, -2, 4], [0, 2, 4]]]


def plane_sums() -> np.ndarray:
    """(1, 3, 16, 16) uint64 of 8 x 8 rays a pixel."""
    scene = bare_scene(TRIANGLES, ambient=(0.5, 0.4, 0.3))
    tracer = Tracer(scene, build_bvh(scene.triangles), open_device(threads=1))
    slab = Slab(CAMERA, 8, 16)
    plane = SensorPlane(CAMERA.focus_distance_m, CAMERA.f_number)
    tile = FrameLayout("macropixels", slab.views, slab.pixels).tile(0, 0, slab.pixels, slab.pixels)
    return tile_sums(tracer, slab, tile, [plane]).sums
