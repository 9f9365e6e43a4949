"""The assignment's light fields as they lie in their files, side by side."""

from lfcore.evaluation.assignment.arrays import overview
from lfcore.evaluation.figures import contact_sheet
from lfcore.storage.tiled_exr import read_array
from lfcore.workflow.job import job

WIDTH = 512

with job(snakemake.log[0], snakemake.threads):
    pictures, labels = [], []
    for name, file in zip(snakemake.params.scenes, snakemake.input, strict=True):
        found = read_array(file)
        (nx, ny), (w, h) = found.array.cameras, found.array.tile
        pictures.append(overview(found.image, WIDTH))
        labels.append(f"{name}: {nx} x {ny} cameras of {w} x {h}")
    contact_sheet(snakemake.output[0], pictures, labels, panel_px=WIDTH)
