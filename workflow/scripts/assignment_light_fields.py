"""Draw the assignment's light fields side by side, each with its cameras' pictures in order."""

from lfcore.evaluation.figures import contact_sheet, shrunk
from lfcore.storage.tiled_exr import read_array
from lfcore.workflow.job import job

WIDTH = 512

with job(snakemake) as (inputs, params, output):
    cells = []
    for name, file in zip(params.scenes, inputs, strict=True):
        picture = read_array(file)
        (nx, ny), (w, h) = picture.array.cameras, picture.array.tile
        label = f"{name}: {nx} x {ny} cameras of {w} x {h}"
        cells.append((shrunk(picture.image, WIDTH), label))
    contact_sheet(output[0], cells, panel_px=WIDTH)
