"""The views from the four corners and the middle of the lens (thesis figure 6.3)."""

import numpy as np

from lfcore.evaluation.pictures import save_stack
from lfcore.opencl.device import open_device
from lfcore.optics.plane_sums import FIXED_ONE, total
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.scene.files import load_scene
from lfcore.storage.layout import FrameLayout
from lfcore.tracing.bvh import load_bvh
from lfcore.tracing.tracer import Tracer
from workflow.job import job

with job(snakemake):
    params = snakemake.params
    scene = load_scene(snakemake.input.scene)
    device = open_device(params.device or None, threads=snakemake.threads)
    tracer = Tracer(scene, load_bvh(snakemake.input.bvh), device)
    slab = Slab(scene.camera, params.angular_resolution, params.spatial_resolution)
    layout = FrameLayout("views", slab.views, slab.pixels)
    # Focused as recorded, a plane takes each ray of a view to its own pixel; the square is the
    # whole grid of lens samples.
    camera, last = scene.camera, slab.views - 1
    plane = SensorPlane(camera.focus_distance_m, camera.f_number, shape="square")
    pictures = []
    for i, j in ((0, 0), (last, 0), (0, last), (last, last), (last // 2, last // 2)):
        tracing = tracer.trace_tile(slab, layout.tile(i, j, 1, 1), [plane], frames=False)
        for _ in tracing:
            pass
        sums = total(slab, [plane], [tracing.plane_sums]).sums[0]
        pictures.append((sums / FIXED_ONE).transpose(1, 2, 0))
    save_stack(snakemake.output[0], np.array(pictures), [plane] * len(pictures))
