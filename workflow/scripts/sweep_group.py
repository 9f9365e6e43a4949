"""One tracing of a sweep, stored by the encoders of all cases that share it."""

from pathlib import Path

from lfcore.evaluation.sweep import sweep_rows
from lfcore.evaluation.table_files import write_rows
from lfcore.optics.slab import Slab
from lfcore.workflow import cases
from lfcore.workflow.batch import open_tracer
from lfcore.workflow.job import job, log_progress

with job(snakemake.log[0], snakemake.threads):
    params, n = snakemake.params, int(snakemake.wildcards.n)
    tracer = open_tracer(snakemake.input, params.device, snakemake.threads)
    scene = tracer.scene
    one = next(iter(params.study.values()))
    rows = sweep_rows(
        tracer,
        Slab.of(scene.camera, n, one["pixels"]),
        cases.tiles(one, n),
        cases.sensor_planes(one["planes"], scene.camera, scene.focus_distances_m),
        {case: cases.encoding(settings, n) for case, settings in params.study.items()},
        Path(snakemake.output[0]).parent,
        progress=log_progress("tiles"),
    )
    write_rows(snakemake.output[0], rows)
