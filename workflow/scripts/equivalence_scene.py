"""Compare one scene's pictures by slicing, by both kinds of shift-sum, and by direct tracing."""

from lfcore.evaluation.equivalence import equivalence
from lfcore.evaluation.storage.figures import equivalence_sheet
from lfcore.evaluation.table_files import write_rows
from lfcore.optics.planes import SensorPlane
from lfcore.workflow.batch import open_tracer
from lfcore.workflow.job import job

with job(snakemake) as (_, params, output):
    # Blocks of one element: each ray has the same colour in every method.
    tracer = open_tracer(snakemake, spanning=False)
    scene = tracer.scene
    camera, focus = scene.camera, scene.focus_distances_m
    focus_m = sorted({min(focus), camera.focus_m, max(focus)})
    rows, pictures = equivalence(
        tracer,
        [SensorPlane(distance, camera.f_number) for distance in focus_m],
        **params.study,
    )
    equivalence_sheet(output.figure, pictures, focus_m)
    write_rows(output.rows, rows)
