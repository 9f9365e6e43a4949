"""Build the bounding volume hierarchy of a scene."""

from lfcore.scene.files import load_scene
from lfcore.tracing.bvh import build_bvh, save_bvh
from lfcore.workflow.job import job, log_progress

with job(snakemake.log[0], snakemake.threads):
    scene = load_scene(snakemake.input.scene)
    bvh = build_bvh(scene.triangles, progress=log_progress("triangles"))
    print(bvh.statistics())
    save_bvh(snakemake.output[0], bvh)
