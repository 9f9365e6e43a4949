"""What is behind, through what stands in front: from the light field, and directly."""

from lfcore.evaluation.assignment.see_through import see_through
from lfcore.evaluation.figures import contact_sheet
from lfcore.files import write_json
from lfcore.refocus.array.device_field import DeviceField
from lfcore.storage.tiled_exr import read_array
from lfcore.workflow.job import job, log_progress
from lfcore.workflow.tracers import open_tracer

with job(snakemake.log[0], snakemake.threads):
    given, params = snakemake.input, snakemake.params
    found = read_array(given.light_field)
    tracer = open_tracer(given, params.device, snakemake.threads)
    pictures, labels, record = see_through(
        DeviceField(tracer.device, found.image, found.array),
        tracer,
        params.study,
        params.picture_px,
        params.reference_samples,
        progress=log_progress("samples"),
    )
    contact_sheet(snakemake.output.figure, pictures, labels, panel_px=300, columns=3)
    write_json(snakemake.output.record, record)
    print(record)
