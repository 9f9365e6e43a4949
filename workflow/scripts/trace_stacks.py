"""Trace the figures' stacks: focus and aperture by depth, and views from five lens samples."""

import numpy as np

from lfcore.optics import bundles
from lfcore.optics.plane_pictures import save_stack
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Lattice, Slab
from lfcore.rendering.by_depth import pictures_by_depth
from lfcore.workflow import cases
from lfcore.workflow.batch import open_tracer
from lfcore.workflow.job import job

LATTICE = Lattice(8, 2)

with job(snakemake) as (_, params, output):
    tracer = open_tracer(snakemake, spanning=False)  # so few rays need no larger blocks
    scene, camera = tracer.scene, tracer.scene.camera
    stacks = {
        "focal_stack": cases.sensor_planes(params.planes, camera, scene.focus_distances_m),
        # Thesis figures 4.3 (dimmed) and 4.4 (normalised).
        "aperture_stack": cases.aperture_stack(params.stops, camera, camera.focus_m),
    }
    for name, planes in stacks.items():
        if name in output.keys():
            pictures = pictures_by_depth(tracer, camera, planes, params.pixels, LATTICE)
            save_stack(output[name], pictures, planes)
    if "sub_aperture_views" in output.keys():  # four corners and the middle: thesis figure 6.3
        slab = Slab.of(camera, params.views, params.pixels)
        last, middle = slab.views - 1, (slab.views - 1) // 2
        samples = np.array([(0, 0), (last, 0), (0, last), (last, last), (middle, middle)])
        pictures = tracer.bundle_radiance(bundles.views(slab, samples), samples).clip(0, 1)
        plane = SensorPlane(camera.focus_m, camera.f_number, aperture="square")
        save_stack(output.sub_aperture_views, pictures, [plane] * len(pictures))
