"""A study on camera arrays: its sheets of pictures, and what was measured."""

from lfcore.evaluation.assignment.book import book
from lfcore.evaluation.assignment.reconstruction import sampling, see_through, time
from lfcore.evaluation.figures import contact_sheet
from lfcore.files import write_json
from lfcore.opencl.device import open_device
from lfcore.workflow.batch import open_tracer
from lfcore.workflow.job import job, log_progress

STUDIES = {"book": book, "sampling": sampling, "see_through": see_through, "time": time}

with job(snakemake.log[0], snakemake.threads):
    given, params, threads = snakemake.input, snakemake.params, snakemake.threads
    if "bvh" in given.keys():
        device_or_tracer = open_tracer(given, params.device, threads)
    else:
        device_or_tracer = open_device(params.device or None, threads=threads)
    files = {key: file for key, file in given.items() if key not in ("scene", "bvh", "light")}
    study, progress = STUDIES[params.study], log_progress(params.study)
    sheets, record = study(device_or_tracer, **files, **params.settings, progress=progress)
    for file, sheet in zip(snakemake.output.figures, sheets, strict=True):
        contact_sheet(file, *sheet, panel_px=300)
    write_json(snakemake.output.record, record)
    print(record)
