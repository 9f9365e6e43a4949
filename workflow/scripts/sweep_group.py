"""Trace once for the new or changed cases of a sweep that share it; store by all encoders."""

from pathlib import Path

from lfcore.evaluation.sweep import sweep_rows
from lfcore.evaluation.table_files import write_rows
from lfcore.optics.slab import Slab
from lfcore.scene.files import scene_digest
from lfcore.workflow import cases
from lfcore.workflow.batch import open_tracer
from lfcore.workflow.job import job
from lfcore.workflow.sweep import made_of, unchanged

with job(snakemake) as (_, params, outputs):
    n, output = int(snakemake.wildcards.n), Path(outputs[0])
    tracer = open_tracer(snakemake)
    scene = tracer.scene
    digests = made_of(params.study, params.version, scene_digest(scene))
    rows = unchanged(output, digests)
    changed = {case: params.study[case] for case in digests.keys() - {row["case"] for row in rows}}
    if changed:
        common = next(iter(changed.values()))
        rows += sweep_rows(
            tracer,
            Slab.of(scene.camera, n, common["pixels"]),
            cases.tiles(common, n),
            cases.sensor_planes(common["planes"], scene.camera, scene.focus_distances_m),
            {case: cases.encoding(settings, n) for case, settings in changed.items()},
            output.parent,
        )
    write_rows(output, [row | {"made_of": digests[row["case"]]} for row in rows])
