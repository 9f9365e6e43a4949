"""The assignment's light fields as they lie in their files, side by side."""

from lfcore.evaluation.figures import contact_sheet, shrunk
from lfcore.storage.tiled_exr import read_array
from lfcore.workflow.job import job

WIDTH = 512

with job(snakemake) as (given, params, output):
    cells = []
    for name, file in zip(params.scenes, given, strict=True):
        found = read_array(file)
        (nx, ny), (w, h) = found.array.cameras, found.array.tile
        label = f"{name}: {nx} x {ny} cameras of {w} x {h}"
        cells.append((shrunk(found.image, WIDTH), label))
    contact_sheet(output[0], cells, panel_px=WIDTH)
