"""Stacks that figures show: a closing lens, and views from five places of the lens."""

import numpy as np

from lfcore.optics import bundles
from lfcore.optics.plane_pictures import save_stack
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.rendering.direct import trace_planes
from lfcore.workflow import cases
from lfcore.workflow.job import job, log_progress
from lfcore.workflow.tracers import open_tracer

with job(snakemake.log[0], snakemake.threads):
    params, output = snakemake.params, snakemake.output
    tracer = open_tracer(snakemake.input, params.device, snakemake.threads)
    camera = tracer.scene.camera
    slab = Slab(camera, params.views, params.pixels)
    if "aperture_stack" in output.keys():  # thesis figures 4.3 (dimmed) and 4.4 (normalised)
        planes = cases.aperture_stack(params.stops, camera, camera.focus_m)
        pictures = trace_planes(tracer, slab, planes, progress=log_progress("pixels"))
        save_stack(output.aperture_stack, pictures, planes)
    if "sub_aperture_views" in output.keys():  # the four corners and the middle: figure 6.3
        last, middle = slab.views - 1, (slab.views - 1) // 2
        samples = np.array([(0, 0), (last, 0), (0, last), (last, last), (middle, middle)])
        pictures = tracer.bundle_radiance(bundles.views(slab, samples), samples).clip(0, 1)
        plane = SensorPlane(camera.focus_m, camera.f_number, aperture="square")
        save_stack(output.sub_aperture_views, pictures, [plane] * len(pictures))
