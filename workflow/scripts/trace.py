"""Trace a batch of tiles: partial sensor planes and, if the light field is stored, segments."""

from lfcore.files import write_json
from lfcore.optics.slab import Slab
from lfcore.rendering.depth import depth_range
from lfcore.timing import Stopwatch, machine
from lfcore.workflow import cases
from lfcore.workflow.batch import open_tracer, trace_batch
from lfcore.workflow.job import job

with job(snakemake) as (_, params, output):
    watch = Stopwatch()
    with watch.part("set_up"):
        tracer = open_tracer(snakemake)
        scene, device = tracer.scene, tracer.device
        slab = Slab.of(scene.camera, int(snakemake.wildcards.n), params.pixels)
        tiles = cases.tiles(params, slab.views)[slice(*params.batch)]
        planes = cases.sensor_planes(params.planes, scene.camera, scene.focus_distances_m)
    sums, facts = trace_batch(
        tracer,
        slab,
        tiles,
        planes,
        segments=output.segments if params.store else None,
        spec=cases.encoding(params, slab.views),
    )
    sums.save(output.planes)
    facts |= {"device": device.name, "threads": device.threads}
    facts |= {"processor": machine()["processor"], "seconds": facts["seconds"] | watch.seconds}
    if params.store and tiles[0].index == 0:  # once per slab
        facts["depth_m"] = depth_range(tracer, slab)
    write_json(output.seconds, facts)
    print(facts)
