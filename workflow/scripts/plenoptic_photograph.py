"""Take the plenoptic photograph in and out of focus; write both, and a sheet of their details."""

from lfcore.evaluation.plenoptic_figure import panels, plenoptic_sheet, take
from lfcore.pictures import write_picture
from lfcore.workflow.batch import open_tracer
from lfcore.workflow.job import job

with job(snakemake) as (_, params, output):
    tracer = open_tracer(snakemake)
    scene = tracer.scene
    focus = scene.focus_distances_m
    rows = []
    # First the far plane is in focus; then none.
    for file, focus_m in zip(output.photographs, (max(focus), scene.camera.focus_m), strict=True):
        photograph = take(tracer, focus_m, **params.camera)
        write_picture(file, photograph[1])
        rows.append(panels(tracer, *photograph, (min(focus), max(focus))))
    plenoptic_sheet(output.sheet, rows)
