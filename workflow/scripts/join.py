"""Add up the planes of all batches and, where the light field is stored, join their segments."""

from lfcore.files import file_digest, read_json, write_json
from lfcore.optics.plane_pictures import save_stack, write_plane_pictures
from lfcore.optics.plane_sums import PlaneSums, total
from lfcore.optics.slab import Slab
from lfcore.workflow import cases
from lfcore.workflow.job import job, log_progress
from lfcore.workflow.joining import joined, traced

with job(snakemake.log[0], snakemake.threads):
    given, params, output = snakemake.input, snakemake.params, snakemake.output
    camera, focus_distances_m, triangles = cases.read_camera(given.scene)
    slab = Slab.of(camera, int(snakemake.wildcards.n), params.pixels)
    planes = cases.sensor_planes(params.planes, camera, focus_distances_m)
    parts = (PlaneSums.load(path, slab, planes) for path in given.planes)
    pictures = total(slab, planes, parts).pictures()
    write_plane_pictures(output.pictures, pictures, planes, suffix=params.picture_format)
    save_stack(output.stack, pictures, planes)
    facts = [read_json(path) for path in given.seconds]
    write_json(output.trace, traced(facts) | {"triangles": triangles})
    if "light_field" in output.keys():
        record = joined(
            output.light_field,
            given.segments,
            facts,
            slab,
            cases.tiles(params, slab.views),
            cases.encoding(params, slab.views),
            scene={"name": snakemake.wildcards.scene, "digest": file_digest(given.scene)},
            progress=log_progress("segments"),
        )
        write_json(output.store, record)
