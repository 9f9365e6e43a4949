"""Step 6: arrays of few cameras, and arrays of many cameras of few pixels at equal storage."""

from lfcore.evaluation.camera_arrays import errors, square_field
from lfcore.evaluation.figures import contact_sheet
from lfcore.files import write_json
from lfcore.refocus.array.focal_surface import parallel
from lfcore.refocus.array.quadrature import quadrature
from lfcore.rendering.photograph import direct_thin_lens
from workflow.assignment import ARRAYS, AUTHORS_FOCUS_M, measured_camera
from workflow.job import job
from workflow.tracer import open_tracer

FEW = (2, 4, 8, 16)
MANY = (4, 8, 16, 32, 64, 128)
SAMPLES = 4
SMALLEST_TILE = 4


def picture(tracer, camera, cameras, tile):
    field = square_field(tracer, cameras, *ARRAYS["book"], tile, SAMPLES)
    return quadrature(field, camera, parallel(AUTHORS_FOCUS_M), 24, 2).image


def compare(tracer, camera, reference, sizes):
    """Pictures, labels and records of arrays of (cameras a side, pixels a side)."""
    pictures, labels, records = [], [], []
    for cameras, tile in sizes:
        made = picture(tracer, camera, cameras, tile)
        found = errors(made, reference)
        pictures.append(made)
        labels.append(f"{cameras} x {cameras} of {tile} x {tile}: {found['psnr_db']:.1f} dB")
        records.append({"cameras_per_dim": cameras, "tile_px": tile, **found})
    return pictures, labels, records


with job(snakemake):
    params = snakemake.params
    tracer = open_tracer(snakemake)
    camera = measured_camera(params.picture_px)
    reference = direct_thin_lens(tracer, camera, AUTHORS_FOCUS_M, params.reference_samples)
    few = compare(tracer, camera, reference, [(cameras, params.tile_px) for cameras in FEW])
    sizes = [(cameras, params.storage_px // cameras) for cameras in MANY]
    sizes = [(cameras, tile) for cameras, tile in sizes if tile >= SMALLEST_TILE]
    many = compare(tracer, camera, reference, sizes)
    for file, (pictures, labels, _) in zip(snakemake.output.figures, (few, many), strict=True):
        pictures, labels = [*pictures, reference], [*labels, "traced directly"]
        contact_sheet(file, pictures, labels, panel_px=300, columns=(len(pictures) + 1) // 2)
    record = {"few": few[2], "many": many[2], "storage_px": params.storage_px}
    write_json(snakemake.output.record, record)
    print(record)
