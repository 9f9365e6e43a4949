"""Time one scene with specialised programs against the general program."""

from lfcore.evaluation.left_out import check_identical, left_out
from lfcore.evaluation.table_files import write_rows
from lfcore.opencl.device import open_device
from lfcore.workflow.batch import open_scene
from lfcore.workflow.job import job

with job(snakemake) as (inputs, params, output):
    scene, bvh = open_scene(inputs)
    device = open_device(params.device or None, threads=snakemake.threads)
    rows = left_out(scene, bvh, device, **params.measured)
    check_identical(rows)
    write_rows(output[0], rows)
