"""The views from the four corners and the middle of the lens (thesis figure 6.3)."""

import numpy as np

from lfcore.optics.plane_pictures import save_stack
from lfcore.optics.plane_sums import FIXED_ONE, total
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.rendering.direct import tile_sums
from lfcore.storage.layout import FrameLayout
from lfcore.workflow.job import job
from lfcore.workflow.tracers import open_tracer

with job(snakemake.log[0], snakemake.threads):
    params = snakemake.params
    tracer = open_tracer(snakemake.input, params.device, snakemake.threads)
    camera = tracer.scene.camera
    slab = Slab(camera, params.angular_resolution, params.spatial_resolution)
    layout = FrameLayout("views", slab.views, slab.pixels)
    # Focused as recorded, a plane takes each ray of a view to its own pixel; the square is the
    # whole grid of lens samples.
    last = slab.views - 1
    plane = SensorPlane(camera.focus_distance_m, camera.f_number, shape="square")
    pictures = []
    for i, j in ((0, 0), (last, 0), (0, last), (last, last), (last // 2, last // 2)):
        part = tile_sums(tracer, slab, layout.tile(i, j, 1, 1), [plane])
        sums = total(slab, [plane], [part]).sums[0]
        pictures.append((sums / FIXED_ONE).transpose(1, 2, 0))
    save_stack(snakemake.output[0], np.array(pictures), [plane] * len(pictures))
