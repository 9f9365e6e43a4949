"""Join the segments of all tiles into one light field file, without encoding them again."""

import hashlib
from pathlib import Path

from lfcore.evaluation.timing import Stopwatch
from lfcore.files import read_json, write_json
from lfcore.optics.slab import Slab
from lfcore.storage.container import join_segments
from workflow import cases
from workflow.job import job, log_progress


def digest(path):
    with Path(path).open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


with job(snakemake):
    watch, params, output = Stopwatch(), snakemake.params, snakemake.output
    views = int(snakemake.wildcards.n)
    camera, _, _ = cases.read_camera(snakemake.input.scene)
    tiles = cases.tiles(params, views)
    with watch.part("join"):
        metadata = join_segments(
            output.light_field,
            snakemake.input.segments,
            tiles,
            tiles[0].layout,
            geometry=Slab(camera, views, params.spatial_resolution),
            scene={"name": snakemake.wildcards.scene, "digest": digest(snakemake.input.scene)},
            spec=cases.codec_spec(params, views),
            progress=log_progress("segments"),
        )
    traced = [read_json(path) for path in snakemake.input.seconds]
    write_json(
        output.seconds,
        {
            "device": traced[0]["processor"],
            "threads": cases.codec_spec(params, views).threads,
            "encode_seconds": sum(tile["seconds"]["encode"] for tile in traced),
            "join_seconds": watch.seconds["join"],
            "video_bytes": Path(output.light_field).stat().st_size,
            "segments": len(metadata.segments),
        },
    )
