"""Step 6: an open shutter before a rolling sphere, sampled at more and more instants."""

from lfcore.evaluation.assignment.sampling import shutter
from lfcore.evaluation.figures import contact_sheet
from lfcore.files import write_json
from lfcore.opencl.device import open_device
from lfcore.scene.pbrt import build_pbrt_scene
from lfcore.workflow.job import job, log_progress

with job(snakemake.log[0], snakemake.threads):
    params = snakemake.params
    scene = build_pbrt_scene(snakemake.input[0])
    device = open_device(params.device or None, threads=snakemake.threads)
    pictures, labels, record = shutter(
        scene, device, params.picture_px, params.instants, progress=log_progress("instants")
    )
    contact_sheet(snakemake.output.figure, pictures, labels, panel_px=300, columns=3)
    write_json(snakemake.output.record, record)
    print(record)
