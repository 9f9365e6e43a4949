"""Run a study on camera arrays; write its sheets of pictures, and its measurements."""

from lfcore.evaluation.assignment.book import book
from lfcore.evaluation.assignment.reconstruction import reconstruction, sampling, see_through, time
from lfcore.evaluation.figures import Sheet, contact_sheet, save_figure
from lfcore.files import write_json
from lfcore.opencl.device import open_device
from lfcore.workflow.batch import open_tracer
from lfcore.workflow.job import job

STUDIES = {study.__name__: study for study in (book, sampling, see_through, time, reconstruction)}

with job(snakemake) as (inputs, params, output):
    if "bvh" in inputs.keys():
        device_or_tracer = open_tracer(snakemake)
    else:
        device_or_tracer = open_device(params.device or None, threads=snakemake.threads)
    files = {key: file for key, file in inputs.items() if key not in ("scene", "bvh", "light")}
    sheets, record = STUDIES[params.study](device_or_tracer, **files, **params.settings)
    for file, sheet in zip(output.figures, sheets, strict=True):
        if isinstance(sheet, Sheet):
            contact_sheet(file, *sheet, panel_px=300)
        else:
            save_figure(file, sheet)
    write_json(output.record, record)
    print(record)
