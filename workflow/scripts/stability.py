"""Run all stability sweeps of the tracer; write a table, a heat map and plots of error growth."""

from lfcore.evaluation.stability import report
from lfcore.evaluation.stability.measurement import COLUMNS, check_passed
from lfcore.evaluation.stability.tested_tracer import TracerUnderTest
from lfcore.evaluation.table_files import write_csv
from lfcore.opencl.device import open_device
from lfcore.workflow.job import job

with job(snakemake) as (_, params, output):
    device = open_device(params.device or None, threads=snakemake.threads)
    tracer = TracerUnderTest(device, rays=params.rays)
    measured = [row for case in report.chosen(params.cases) for row in case(tracer)]
    table = report.stability_table(measured)
    print(report.summary(table))
    check_passed(measured)
    write_csv(output.csv, table[COLUMNS])
    write_csv(output.cases, report.cases_table(table))
    report.heat_map(output.heat_map, table)
    report.error_growth(output.error_growth, table)
