"""The lattice that true pictures recommend, recorded with depth, beside the thesis's largest N."""

import pandas as pd

from lfcore.evaluation.table_files import write_rows
from lfcore.evaluation.true_picture.choice import our_choice, recommended, thesis_recipe
from lfcore.evaluation.true_picture.reference import load_reference
from lfcore.files import read_json
from lfcore.optics.plane_pictures import load_stack
from lfcore.workflow.job import job
from lfcore.workflow.tracers import open_tracer

with job(snakemake.log[0], snakemake.threads):
    given, params = snakemake.input, snakemake.params
    reference = load_reference(given.wide)
    tracer = open_tracer(given, params.device, snakemake.threads)
    jobs = [read_json(file) for file in (given.trace, given.store, given.retrieve)]
    retrieved = load_stack(given.from_video)[0]
    theirs = thesis_recipe(tracer.scene.name, reference, params.views, jobs, retrieved)
    count = recommended(pd.DataFrame(read_json(given.true_picture)["rows"]))
    ours = our_choice(snakemake.output.light_field, tracer, reference, count)
    write_rows(snakemake.output.rows, [theirs, ours])
