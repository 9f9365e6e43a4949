"""Rate and distortion of one scene, on samples."""

from lfcore.evaluation.storage.rate_distortion import RateStudy, rate_rows
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
    rows = rate_rows(
        Tracer(scene, bvh, device),
        RateStudy(**params.study),
        params.spatial_resolution,
        progress=log_progress("points"),
    )
    write_rows(snakemake.output[0], rows)
