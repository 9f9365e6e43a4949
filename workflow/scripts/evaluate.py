"""Rows of the thesis's tables for one scene: pictures against pictures, seconds, sizes."""

from lfcore.evaluation.table_files import write_rows
from lfcore.evaluation.tables import scene_records
from lfcore.workflow.job import job

with job(snakemake) as (given, params, output):
    parts = [given.on_the_fly, given.trace]
    if "store" in given.keys():
        parts += [given.from_video, given.store, given.retrieve]
    files = dict(zip(params.views, zip(*parts, strict=True), strict=True))
    scene, pixels = snakemake.wildcards.scene, params.pixels
    write_rows(output[0], scene_records(scene, pixels, files, given.truth))
