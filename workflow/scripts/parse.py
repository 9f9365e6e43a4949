"""Read a scene description and all its files into flat arrays in camera space."""

from lfcore.readers.load import load_scene
from lfcore.scene.files import save_scene
from lfcore.workflow.job import job

with job(snakemake) as (inputs, _, output):
    scene = load_scene(inputs[0], bare=True)
    if scene.is_pinhole:
        scene = scene.with_lens()
        print("a lens is fitted: all views of a pinhole camera would be the same")
    print(f"{scene.triangle_count} triangles, dropped: {scene.dropped or 'none'}")
    save_scene(output[0], scene)
