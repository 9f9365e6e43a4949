"""Pictures from the book's light field: steps 3, 4 and 5 of the assignment."""

from lfcore.evaluation.assignment.book import focal_surfaces, realistic_lens, synthesis
from lfcore.evaluation.figures import contact_sheet
from lfcore.files import write_json
from lfcore.opencl.device import open_device
from lfcore.refocus.array.device_field import DeviceField
from lfcore.storage.tiled_exr import read_array
from lfcore.workflow.job import job

with job(snakemake.log[0], snakemake.threads):
    params, output = snakemake.params, snakemake.output
    found = read_array(snakemake.input.light_field)
    device = open_device(params.device or None, threads=snakemake.threads)
    field = DeviceField(device, found.image, found.array)
    pictures, labels, record = synthesis(field, params.picture_px)
    contact_sheet(output.figures[0], pictures, labels, panel_px=300)
    pictures, labels = focal_surfaces(field, params.picture_px)
    contact_sheet(output.figures[1], pictures, labels, panel_px=300, columns=2)
    pictures, labels, lens = realistic_lens(field, params.picture_px, snakemake.input.lens)
    contact_sheet(output.figures[2], pictures, labels, panel_px=300, columns=2)
    write_json(output.record, {"synthesis": record, "realistic_lens": lens})
    print(record, lens)
