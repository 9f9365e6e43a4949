"""One scene's pictures by slicing, by both kinds of shift-sum, and traced directly."""

from lfcore.evaluation.equivalence import equivalence
from lfcore.evaluation.storage.figures import equivalence_sheet
from lfcore.evaluation.storage.table import write_rows
from lfcore.opencl.device import open_device
from lfcore.optics.planes import SensorPlane
from lfcore.scene.files import load_scene
from lfcore.tracing.bvh import load_bvh
from lfcore.tracing.tracer import Tracer
from workflow.job import job, log_progress

with job(snakemake):
    params, output = snakemake.params, snakemake.output
    scene = load_scene(snakemake.input.scene)
    device = open_device(params.device or None, threads=snakemake.threads)
    camera, focus = scene.camera, scene.focus_distances_m
    focus_m = sorted({min(focus), camera.focus_distance_m, max(focus)})
    found = equivalence(
        Tracer(scene, load_bvh(snakemake.input.bvh), device),
        camera,
        [SensorPlane(distance, camera.f_number) for distance in focus_m],
        **params.study,
        progress=log_progress("methods"),
    )
    equivalence_sheet(output.figure, found, focus_m)
    write_rows(output.rows, found.table.to_dict("records"))
