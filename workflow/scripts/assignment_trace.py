"""Trace a scene by its camera array into one tiled EXR."""

from pathlib import Path

from lfcore.evaluation.assignment.arrays import array_of, trace_to_exr
from lfcore.files import write_json
from lfcore.workflow.batch import open_tracer
from lfcore.workflow.job import job

with job(snakemake) as (_, params, output):
    tracer = open_tracer(snakemake)
    array = array_of(tracer.scene, params.grid, params.cameras_per_dim, params.tile_px)
    record = trace_to_exr(tracer, array, params.samples_per_pixel, Path(output.light_field))
    record["scene"] = snakemake.wildcards.scene
    write_json(output.record, record)
    print(record)
