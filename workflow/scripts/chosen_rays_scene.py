"""Record one scene's light fields to requested qualities; write rows beside the thesis's recipe."""

from lfcore.evaluation.chosen_rays import chosen_row, thesis_row
from lfcore.evaluation.table_files import write_rows
from lfcore.evaluation.true_picture import load_reference
from lfcore.files import read_json
from lfcore.opencl.device import open_device
from lfcore.optics.plane_pictures import load_stack
from lfcore.scene.files import read_scene
from lfcore.workflow.job import job

with job(snakemake) as (inputs, params, output):
    scene, reference = read_scene(inputs.scene), load_reference(inputs.truth)
    device = open_device(params.device or None, threads=snakemake.threads)
    jobs = [read_json(file) for file in (inputs.trace, inputs.store, inputs.retrieve)]
    pictures = [load_stack(file)[0] for file in (inputs.on_the_fly, inputs.from_video)]
    rows = [thesis_row(scene.name, reference, params.views, jobs, *pictures)]
    for quality_db, file in zip(params.qualities_db, output.light_fields, strict=True):
        rows.append(chosen_row(file, scene, device, reference, quality_db))
        print(f"{rows[-1]['lattice']} rays per pixel for {quality_db:g} dB")
    write_rows(output.rows, rows)
