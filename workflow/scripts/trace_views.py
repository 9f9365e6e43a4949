"""The views from the four corners and the middle of the lens (thesis figure 6.3)."""

import numpy as np

from lfcore.optics import bundles
from lfcore.optics.plane_pictures import save_stack
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.workflow.job import job
from lfcore.workflow.tracers import open_tracer

with job(snakemake.log[0], snakemake.threads):
    params = snakemake.params
    tracer = open_tracer(snakemake.input, params.device, snakemake.threads)
    camera = tracer.scene.camera
    slab = Slab(camera, params.angular_resolution, params.spatial_resolution)
    last, middle = slab.views - 1, (slab.views - 1) // 2
    samples = np.array([(0, 0), (last, 0), (0, last), (last, last), (middle, middle)])
    pictures = tracer.bundle_radiance(bundles.views(slab, samples), samples).clip(0, 1)
    plane = SensorPlane(camera.focus_distance_m, camera.f_number, shape="square")
    save_stack(snakemake.output[0], pictures, [plane] * len(pictures))
