"""Add the planes of all batches and, if the light field is stored, join their segments."""

from pathlib import Path

from lfcore.files import file_digest, read_json, write_json
from lfcore.optics.plane_pictures import save_stack, write_plane_pictures
from lfcore.optics.plane_sums import PlaneSums, total
from lfcore.optics.slab import Slab
from lfcore.timing import Stopwatch
from lfcore.workflow import cases
from lfcore.workflow.job import job

with job(snakemake) as (inputs, params, output):
    camera, focus_distances_m, triangles = cases.read_camera(inputs.scene)
    slab = Slab.of(camera, int(snakemake.wildcards.n), params.pixels)
    planes = cases.sensor_planes(params.planes, camera, focus_distances_m)
    parts = (PlaneSums.load(path, slab, planes) for path in inputs.planes)
    pictures = total(slab, planes, parts).pictures()
    write_plane_pictures(output.pictures, pictures, planes, suffix=params.picture_format)
    save_stack(output.stack, pictures, planes)
    facts = [read_json(path) for path in inputs.seconds]
    encode_seconds = sum(batch["seconds"]["encode"] for batch in facts)
    traced = {
        "seconds": sum(batch["seconds"]["trace"] for batch in facts),
        "encode_seconds": encode_seconds,
        "rays": sum(batch["rays"] for batch in facts),
        "device": facts[0]["device"],
        "threads": facts[0]["threads"],
        "triangles": triangles,
    }
    write_json(output.trace, traced)
    if "light_field" in output.keys():
        from lfcore.storage.container import join_segments, unpacked  # loads the codecs

        tiles, spec = cases.tiles(params, slab.views), cases.encoding(params, slab.views)
        depth = facts[0].get("depth_m")  # the range of visible depths
        watch = Stopwatch()
        with watch.part("join"), unpacked(inputs.segments, output.light_field) as segments:
            metadata = join_segments(
                output.light_field,
                segments,
                tiles,
                tiles[0].layout,
                geometry=slab,
                scene={"name": snakemake.wildcards.scene, "digest": file_digest(inputs.scene)},
                spec=spec,
                content={"depth_m": depth} if depth else None,
            )
        stored = {
            "device": facts[0]["processor"],
            "threads": spec.threads,
            "encode_seconds": encode_seconds,
            "join_seconds": watch.seconds["join"],
            "video_bytes": Path(output.light_field).stat().st_size,
            "segments": len(metadata.segments),
        }
        write_json(output.store, stored)
