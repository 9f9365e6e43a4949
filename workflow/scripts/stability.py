"""All stability sweeps of the tracer, as a table, a heat map and plots of error growth."""

from lfcore.evaluation import stability_report
from lfcore.evaluation.stability.about import cases_table
from lfcore.evaluation.stability.all_cases import chosen, run_all
from lfcore.evaluation.stability.rows import check_rows
from lfcore.evaluation.stability.subject import tracer_subject
from lfcore.evaluation.table_files import write_csv
from lfcore.opencl.device import open_device
from lfcore.workflow.job import job, log_progress

with job(snakemake.log[0], snakemake.threads):
    params, output = snakemake.params, snakemake.output
    device = open_device(params.device or None, threads=snakemake.threads)
    subject = tracer_subject(device, rays=params.rays)
    rows = run_all(subject, chosen(params.cases), progress=log_progress("cases"))
    table = stability_report.stability_table(rows)
    print(stability_report.summary(table))
    check_rows(rows)
    write_csv(output.csv, table)
    write_csv(output.cases, cases_table(rows))
    stability_report.heat_map(output.heat_map, table)
    stability_report.error_growth(output.error_growth, table)
