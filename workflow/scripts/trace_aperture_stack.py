"""One focus through a closing lens: thesis figures 4.3 (dimmed) and 4.4 (normalised)."""

from lfcore.optics.plane_pictures import save_stack
from lfcore.optics.plane_sums import total
from lfcore.optics.slab import Slab
from lfcore.storage.layout import FrameLayout
from workflow import cases
from workflow.job import job, log_progress
from workflow.tracer import open_tracer

with job(snakemake):
    params = snakemake.params
    tracer = open_tracer(snakemake)
    camera = tracer.scene.camera
    slab = Slab(camera, params.angular_resolution, params.spatial_resolution)
    planes = cases.aperture_stack(params.stops, camera, camera.focus_distance_m)
    whole = FrameLayout("macropixels", slab.views, slab.pixels).tile(0, 0, slab.pixels, slab.pixels)
    tracing = tracer.trace_tile(
        slab, whole, planes, frames=False, progress=log_progress("elements")
    )
    for _ in tracing:
        pass  # without frames, an iteration is a step of the tracing
    sums = total(slab, planes, [tracing.plane_sums])
    save_stack(snakemake.output[0], sums.pictures(), planes)
