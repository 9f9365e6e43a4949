# From scenes to tables: see README.md for the two commands, config/README.md for every key, and
# docs/architecture.md for how data flows.
from snakemake.utils import min_version

min_version("9.0")


configfile: f"{workflow.basedir}/config/config.yaml"


report: "workflow/report/workflow.rst"


include: "workflow/rules/common.smk"


# Jobs of this run end with it, however that is; see workflow/run.py.
onstart:
    hold()


rule all:
    default_target: True
    input:
        "results/tables/index.html",
    localrule: True


include: "workflow/rules/scene.smk"
include: "workflow/rules/trace.smk"
include: "workflow/rules/store.smk"
include: "workflow/rules/evaluate.smk"
include: "workflow/rules/figures.smk"
include: "workflow/rules/storage.smk"
include: "workflow/rules/analysis.smk"
include: "workflow/rules/assignment.smk"
include: "workflow/rules/report.smk"
