"""Points of one scene's work-precision diagrams."""

from lfcore.evaluation.work_precision.curves import scene_rows
from lfcore.evaluation.work_precision.study import Study
from lfcore.files import write_json
from lfcore.opencl.device import open_device
from lfcore.scene.files import load_scene
from lfcore.tracing.bvh import load_bvh
from lfcore.tracing.tracer import Tracer
from lfcore.workflow.job import job, log_progress

with job(snakemake.log[0], snakemake.threads):
    scene, bvh = load_scene(snakemake.input.scene), load_bvh(snakemake.input.bvh)
    device = open_device(snakemake.params.device or None, threads=snakemake.threads)
    study = Study(**snakemake.params.study)
    rows = scene_rows(Tracer(scene, bvh, device), bvh, study, progress=log_progress("diagrams"))
    write_json(
        snakemake.output[0], {"device": device.name, "threads": device.threads, "rows": rows}
    )
