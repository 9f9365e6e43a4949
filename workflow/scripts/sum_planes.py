"""Add up the partial planes of all tiles, and write them as pictures."""

from lfcore.files import read_json, write_json
from lfcore.optics.plane_pictures import save_stack, write_plane_pictures
from lfcore.optics.plane_sums import PlaneSums, total
from lfcore.optics.slab import Slab
from lfcore.workflow import cases
from lfcore.workflow.job import job

with job(snakemake.log[0], snakemake.threads):
    params, output = snakemake.params, snakemake.output
    camera, focus_distances_m, triangles = cases.read_camera(snakemake.input.scene)
    slab = Slab(camera, int(snakemake.wildcards.n), params.spatial_resolution)
    planes = cases.sensor_planes(params.planes, camera, focus_distances_m)
    parts = (PlaneSums.load(path, slab, planes) for path in snakemake.input.planes)
    pictures = total(slab, planes, parts).pictures()
    write_plane_pictures(output.pictures, pictures, planes, suffix=params.picture_format)
    save_stack(output.stack, pictures, planes)
    tiles = [read_json(path) for path in snakemake.input.seconds]
    write_json(
        output.seconds,
        {
            "seconds": sum(tile["seconds"]["trace"] for tile in tiles),
            "encode_seconds": sum(tile["seconds"]["encode"] for tile in tiles),
            "rays": sum(tile["rays"] for tile in tiles),
            "memory_mib": max(tile["memory_mib"] for tile in tiles),
            "triangles": triangles,
            "device": tiles[0]["device"],
            "threads": tiles[0]["threads"],
        },
    )
