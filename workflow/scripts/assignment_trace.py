"""Trace a scene by the assignment's camera array into one tiled EXR."""

import time
from pathlib import Path

from lfcore.files import write_json
from lfcore.optics.array import CameraArray
from lfcore.rendering.array import trace_array
from lfcore.storage.tiled_exr import write_array
from workflow.assignment import ARRAYS
from workflow.job import job, log_progress
from workflow.tracer import open_tracer

with job(snakemake):
    params, name = snakemake.params, snakemake.wildcards.scene
    tracer = open_tracer(snakemake)
    bounds, fov_deg = ARRAYS[name]
    cameras, tile = (2 * (size,) for size in (params.cameras_per_dim, params.tile_px))
    array = CameraArray.on_grid(cameras, bounds, fov_deg, tile)
    # Kernels are built for the size of a tile: one camera of it, unseen by the clock.
    trace_array(tracer, CameraArray.single(fov_deg, tile))
    begun = time.perf_counter()
    image = trace_array(tracer, array, params.samples_per_pixel, progress=log_progress("samples"))
    seconds = time.perf_counter() - begun
    write_array(snakemake.output.light_field, image, array, half=True, extra={"scene": name})
    record = {
        "scene": name,
        "cameras": len(array.columns_m) * len(array.rows_m),
        "pixels": array.tile[0] * array.tile[1],
        "seconds": seconds,
        "mrays_per_second": array.rays * params.samples_per_pixel / seconds / 1e6,
        "bytes": Path(snakemake.output.light_field).stat().st_size,
    }
    write_json(snakemake.output.record, record)
    print(record)
