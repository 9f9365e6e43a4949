"""Step 6: arrays of few cameras, and arrays of many cameras of few pixels at equal storage."""

from lfcore.evaluation.assignment.sampling import compare_arrays
from lfcore.evaluation.figures import contact_sheet
from lfcore.files import write_json
from lfcore.workflow.job import job
from lfcore.workflow.tracers import open_tracer

with job(snakemake.log[0], snakemake.threads):
    given, params = snakemake.input, snakemake.params
    tracer = open_tracer(given, params.device, snakemake.threads)
    sizes = params.picture_px, params.tile_px, params.storage_px, params.reference_samples
    few, many = compare_arrays(tracer, params.grid, *sizes)
    for file, (pictures, labels, _) in zip(snakemake.output.figures, (few, many), strict=True):
        contact_sheet(file, pictures, labels, panel_px=300, columns=(len(pictures) + 1) // 2)
    record = {"few": few[2], "many": many[2], "storage_px": params.storage_px}
    write_json(snakemake.output.record, record)
    print(record)
