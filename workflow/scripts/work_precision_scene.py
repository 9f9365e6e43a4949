"""Measure error against run time: the points of one scene."""

from lfcore.evaluation.true_picture import load_reference
from lfcore.evaluation.work_precision import study
from lfcore.files import read_json, write_json
from lfcore.optics.plane_pictures import load_stack
from lfcore.workflow.batch import open_tracer
from lfcore.workflow.job import job

with job(snakemake) as (inputs, params, output):
    wide, stopped = load_reference(inputs.wide), load_reference(inputs.stopped)
    tracer = open_tracer(snakemake, spanning=False)  # the timed work uses these blocks, too
    grids = []
    for k, views in enumerate(params.views):
        traced = read_json(inputs.trace[k])
        grids.append(study.traced_grid(wide, views, load_stack(inputs.on_the_fly[k])[0], traced))
        if "from_video" in inputs.keys():
            jobs = traced, read_json(inputs.store[k]), read_json(inputs.retrieve[k])
            grids.append(study.grid_row(wide, views, load_stack(inputs.from_video[k])[0], jobs))
    rows = study.scene_rows(tracer, wide, stopped, grids, params.study)
    write_json(output[0], {"device": tracer.device.name, "rows": rows})
