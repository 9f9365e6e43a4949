"""All methods over cameras a side against a directly traced thin lens, and Monte Carlo's slope."""

from lfcore.evaluation.assignment.reconstruction import reconstruction, reconstruction_figure
from lfcore.evaluation.figures import save_figure
from lfcore.files import write_json
from lfcore.workflow.batch import open_tracer
from lfcore.workflow.job import job

with job(snakemake.log[0], snakemake.threads):
    given, params = snakemake.input, snakemake.params
    tracer = open_tracer(given, params.device, snakemake.threads)
    record = reconstruction(tracer, params.grid, **params.study)
    figure = reconstruction_figure(record["rows"], record["convergence"])
    save_figure(snakemake.output.figure, figure)
    write_json(snakemake.output.record, record)
    print(record["convergence"])
