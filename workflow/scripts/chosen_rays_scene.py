"""A light field of one scene whose rays a pilot chooses: pictures, a file, and their errors."""

from lfcore.evaluation.table_files import write_rows
from lfcore.evaluation.true_picture.reference import load_reference
from lfcore.optics.plane_pictures import save_stack, write_plane_pictures
from lfcore.timing import Stopwatch
from lfcore.workflow import cases
from lfcore.workflow.chosen_rays import choose_rays
from lfcore.workflow.job import job
from lfcore.workflow.tracers import open_tracer

with job(snakemake.log[0], snakemake.threads):
    given, params, output, watch = snakemake.input, snakemake.params, snakemake.output, Stopwatch()
    tracer, stored = open_tracer(given, params.device, snakemake.threads), None
    scene = tracer.scene
    planes = cases.sensor_planes(params.planes, scene.camera, scene.focus_distances_m)
    with watch.part("pilot"):
        chosen = choose_rays(tracer, planes, params.pixels, params.quality_db)
    with watch.part("trace"):
        pictures = chosen.pictures(tracer)
    write_plane_pictures(output.pictures, pictures, planes, suffix=params.picture_format)
    save_stack(output.stack, pictures, planes)
    measured = {f"{part}_seconds": seconds for part, seconds in watch.seconds.items()}
    if "light_field" in output.keys():
        with watch.part("store"):
            size = chosen.record(output.light_field, tracer, params.encoding, params.layout)
        stored = chosen.stored_pictures(output.light_field, tracer)
        measured |= {"store_seconds": watch.seconds["store"], "bytes": size}
    row = chosen.row(
        load_reference(given.truth), pictures, stored, scene=scene.name,
        quality_db=params.quality_db, **measured,
    )  # fmt: skip
    write_rows(output.rows, [row])
    print(f"{row['lattice']} rays of a pixel are expected to reach {row['expected_db']:.1f} dB")
