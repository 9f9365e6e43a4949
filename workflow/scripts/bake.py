"""Bake the light of a scene's sky and bounces."""

from lfcore.baking.bake import bake_light
from lfcore.opencl.device import open_device
from lfcore.workflow.batch import open_scene
from lfcore.workflow.job import job

with job(snakemake) as (inputs, params, output):
    scene, bvh = open_scene(inputs)
    device = open_device(params.device or None, threads=snakemake.threads)
    light = bake_light(scene, bvh, device, scene.bake)
    print(f"{light.rays} rays, {len(light.values)} points, error {light.error:.3g}")
    light.save(output[0])
