"""Every layout of one scene's light fields, on samples."""

from lfcore.evaluation.storage.layouts import LayoutStudy, layout_rows
from lfcore.evaluation.storage.table import write_rows
from lfcore.opencl.device import open_device
from lfcore.scene.files import load_scene
from lfcore.tracing.bvh import load_bvh
from lfcore.tracing.tracer import Tracer
from workflow.job import job, log_progress

with job(snakemake):
    params = snakemake.params
    scene, bvh = load_scene(snakemake.input.scene), load_bvh(snakemake.input.bvh)
    device = open_device(params.device or None, threads=snakemake.threads)
    rows = layout_rows(
        Tracer(scene, bvh, device),
        LayoutStudy(**params.study),
        params.spatial_resolution,
        progress=log_progress("layouts"),
    )
    write_rows(snakemake.output[0], rows)
