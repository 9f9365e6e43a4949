"""Build the bounding volume hierarchy of a scene."""

from lfcore.scene.files import read_scene
from lfcore.tracing.bvh import build_bvh, save_bvh
from lfcore.workflow.job import job

with job(snakemake) as (inputs, _, output):
    scene = read_scene(inputs.scene)
    bvh = build_bvh(scene.triangles)
    print(f"{len(bvh.children)} nodes, {bvh.leaf_count} leaves")
    save_bvh(output[0], bvh)
