"""Trace one tile: partial sensor planes and, where the light field is stored, its segment."""

from lfcore.evaluation.timing import Stopwatch, machine
from lfcore.files import write_json
from lfcore.optics.slab import Slab
from lfcore.rendering.depth import depth_range
from lfcore.rendering.direct import finished
from lfcore.workflow import cases
from lfcore.workflow.job import job, log_progress
from lfcore.workflow.tracers import open_tracer

with job(snakemake.log[0], snakemake.threads):
    watch, params, output = Stopwatch(), snakemake.params, snakemake.output
    with watch.part("set_up"):
        tracer = open_tracer(snakemake.input, params.device, snakemake.threads, lean=True)
        scene, device = tracer.scene, tracer.device
        slab = Slab(scene.camera, int(snakemake.wildcards.n), params.spatial_resolution)
        tile = cases.tiles(params, slab.views)[int(snakemake.wildcards.tile)]
        planes = cases.sensor_planes(params.planes, scene.camera, scene.focus_distances_m)
    progress, spec = log_progress("elements"), cases.codec_spec(params, slab.views)
    if params.store:
        from lfcore.rendering.record import record_tile  # loads the codecs

        asked = tracer, slab, tile, output.segment, spec, planes
        tracing, encode = record_tile(*asked, progress=progress)
    else:
        tracing = finished(tracer.trace_tile(slab, tile, planes, frames=False, progress=progress))
        encode = 0.0
    tracing.plane_sums.save(output.planes)
    facts = {"rays": tracing.rays, "device": device.name, "threads": device.threads}
    facts["seconds"] = {"trace": tracing.seconds, "encode": encode, **watch.seconds}
    facts["processor"] = machine()["processor"]
    if params.store and tile.index == 0:  # of the whole slab, once
        facts["depth_m"] = depth_range(tracer, slab)
    write_json(output.seconds, facts)
    print(facts)
