"""Write one scene's rows of the thesis's tables: errors of pictures, seconds, sizes."""

from lfcore.evaluation.table_files import write_rows
from lfcore.evaluation.tables import scene_records
from lfcore.workflow.job import job

with job(snakemake) as (inputs, params, output):
    parts = [inputs.on_the_fly, inputs.trace]
    if "store" in inputs.keys():
        parts += [inputs.from_video, inputs.store, inputs.retrieve]
    files = dict(zip(params.views, zip(*parts, strict=True), strict=True))
    scene, pixels = snakemake.wildcards.scene, params.pixels
    write_rows(output[0], scene_records(scene, pixels, files, inputs.truth))
