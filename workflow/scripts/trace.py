"""Trace one tile: partial sensor planes and, where the light field is stored, its segment."""

from contextlib import nullcontext

from lfcore.evaluation.timing import Stopwatch, machine
from lfcore.files import write_json
from lfcore.opencl.device import open_device
from lfcore.optics.slab import Slab
from lfcore.scene.files import load_scene
from lfcore.tracing import reach
from lfcore.tracing.bvh import load_bvh
from lfcore.tracing.tracer import Tracer
from workflow import cases
from workflow.job import job, log_progress


def trace_and_store(tracing, writer, watch):
    """Frames go from the tracer to the encoder as they come; none touches the disk."""
    for chunk in watch.each("trace", iter(tracing)):
        if writer is not None:
            writer.write(chunk.frames)


with job(snakemake):
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
    writing = nullcontext()
    if params.store:
        from lfcore.storage.segment import SegmentWriter  # no codecs where nothing is stored

        size = tile.layout.frame_width, tile.layout.frame_height
        writing = SegmentWriter(output.segment, cases.codec_spec(params, slab.views), *size)
    with watch.part("trace_and_encode"), writing as writer:
        trace_and_store(tracing, writer, watch)
    tracing.plane_sums.save(output.planes)
    seconds = {**watch.seconds}
    seconds["encode"] = seconds.pop("trace_and_encode") - seconds["trace"] if params.store else 0.0
    facts = {"rays": tracing.rays, "device": device.name, "threads": device.threads}
    facts["processor"] = machine()["processor"]
    write_json(output.seconds, {**facts, "seconds": seconds})
    print(facts, seconds)
