"""Join the segments of all tiles into one light field file, without encoding them again."""

from pathlib import Path

from lfcore.evaluation.timing import Stopwatch
from lfcore.files import file_digest, read_json, write_json
from lfcore.optics.slab import Slab
from lfcore.storage.container import join_segments
from lfcore.workflow import cases
from lfcore.workflow.job import job, log_progress

with job(snakemake.log[0], snakemake.threads):
    watch, given, params = Stopwatch(), snakemake.input, snakemake.params
    views, file = int(snakemake.wildcards.n), snakemake.output.light_field
    camera, _, _ = cases.read_camera(given.scene)
    tiles, spec = cases.tiles(params, views), cases.codec_spec(params, views)
    traced = [read_json(path) for path in given.seconds]
    depth = traced[0].get("depth_m")
    with watch.part("join"):
        metadata = join_segments(
            file,
            given.segments,
            tiles,
            tiles[0].layout,
            geometry=Slab(camera, views, params.spatial_resolution),
            scene={"name": snakemake.wildcards.scene, "digest": file_digest(given.scene)},
            spec=spec,
            content={"depth_m": depth} if depth else None,
            progress=log_progress("segments"),
        )
    record = {
        "device": traced[0]["processor"],
        "threads": spec.threads,
        "encode_seconds": sum(tile["seconds"]["encode"] for tile in traced),
        "join_seconds": watch.seconds["join"],
        "video_bytes": Path(file).stat().st_size,
        "segments": len(metadata.segments),
    }
    write_json(snakemake.output.seconds, record)
