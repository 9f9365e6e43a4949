"""Error against run time: the points of one scene."""

from lfcore.evaluation.true_picture import load_reference
from lfcore.evaluation.work_precision import study
from lfcore.files import read_json, write_json
from lfcore.optics.plane_pictures import load_stack
from lfcore.workflow.batch import open_tracer
from lfcore.workflow.job import job

with job(snakemake) as (given, params, output):
    wide, stopped = load_reference(given.wide), load_reference(given.stopped)
    tracer = open_tracer(snakemake, outer=1)  # what is timed takes these blocks anyway
    grids = []
    for at, views in enumerate(params.views):
        traced = read_json(given.trace[at])
        grids.append(study.traced_grid(wide, views, load_stack(given.on_the_fly[at])[0], traced))
        if "from_video" in given.keys():
            jobs = traced, read_json(given.store[at]), read_json(given.retrieve[at])
            grids.append(study.grid_row(wide, views, load_stack(given.from_video[at])[0], jobs))
    rows = study.scene_rows(tracer, wide, stopped, grids, params.study)
    write_json(output[0], {"device": tracer.device.name, "rows": rows})
