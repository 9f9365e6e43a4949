"""Trace one tile: partial sensor planes and, where the light field is stored, its segment."""

from lfcore.evaluation.timing import Stopwatch, machine
from lfcore.files import write_json
from lfcore.opencl.device import open_device
from lfcore.optics.slab import Slab
from lfcore.rendering.depth import depth_range
from lfcore.scene.files import load_scene
from lfcore.tracing import reach
from lfcore.tracing.bvh import load_bvh
from lfcore.tracing.tracer import Tracer
from lfcore.workflow import cases
from lfcore.workflow.job import job, log_progress
from lfcore.workflow.tile import trace_and_encode

with job(snakemake.log[0], snakemake.threads):
    watch, params, output = Stopwatch(), snakemake.params, snakemake.output
    with watch.part("set_up"):
        scene = load_scene(snakemake.input.scene)
        device = open_device(params.device or None, threads=snakemake.threads)
        # What these rays and their shadows cannot meet is not sent to the device.
        tracer = Tracer(*reach.lean(scene, load_bvh(snakemake.input.bvh), scene.camera), device)
        slab = Slab(scene.camera, int(snakemake.wildcards.n), params.spatial_resolution)
        tile = cases.tiles(params, slab.views)[int(snakemake.wildcards.tile)]
        planes = cases.sensor_planes(params.planes, scene.camera, scene.focus_distances_m)
        tracing = tracer.trace_tile(
            slab, tile, planes, frames=params.store, progress=log_progress("elements")
        )
    segment = output.segment if params.store else None
    seconds = trace_and_encode(tracing, tile, segment, cases.codec_spec(params, slab.views))
    tracing.plane_sums.save(output.planes)
    seconds |= watch.seconds
    facts = {"rays": tracing.rays, "device": device.name, "threads": device.threads}
    facts |= {"processor": machine()["processor"], "seconds": seconds}
    if params.store and tile.index == 0:  # of the whole slab, once
        facts["depth_m"] = depth_range(tracer, slab)
    write_json(output.seconds, facts)
    print(facts)
