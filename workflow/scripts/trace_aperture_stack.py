"""One focus through a closing lens: thesis figures 4.3 (dimmed) and 4.4 (normalised)."""

from lfcore.optics.plane_pictures import save_stack
from lfcore.optics.slab import Slab
from lfcore.rendering.direct import trace_planes
from lfcore.workflow import cases
from lfcore.workflow.job import job, log_progress
from lfcore.workflow.tracers import open_tracer

with job(snakemake.log[0], snakemake.threads):
    params = snakemake.params
    tracer = open_tracer(snakemake.input, params.device, snakemake.threads)
    camera = tracer.scene.camera
    slab = Slab(camera, params.angular_resolution, params.spatial_resolution)
    planes = cases.aperture_stack(params.stops, camera, camera.focus_distance_m)
    pictures = trace_planes(tracer, slab, planes, progress=log_progress("pixels"))
    save_stack(snakemake.output[0], pictures, planes)
