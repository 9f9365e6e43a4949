# From scenes to tables: see README.md for the two commands, config/README.md for every key, and
# docs/architecture.md for how data flows.
from pathlib import Path

from snakemake.utils import min_version

from lfcore.workflow.cluster import check_bucket, check_partition
from lfcore.workflow import progress
from lfcore.workflow.run import hold, schedule_when_jobs_end

min_version("9.0")
progress.hush(workflow)

# Of this file, also where another workflow takes it as a module.
ROOT = Path(workflow.current_basedir.get_path_or_uri(secret_free=False))


configfile: ROOT / "config" / "config.yaml"


report: "workflow/report/workflow.rst"


# Jobs of this run end with it, however that is; see lfcore/workflow/run.py.
onstart:
    hold()
    schedule_when_jobs_end(workflow)
    partition = workflow.resource_settings._parsed_default_resources.get("slurm_partition")
    storage = workflow.storage_registry.default_storage_provider
    try:
        check_partition(partition and partition.raw)
        check_bucket(storage, workflow.storage_settings.default_storage_prefix)
        jobs = progress.known_jobs(workflow.dag, PARSED, PIXELS, BATCHES)
        progress.begin(workflow, jobs, PIXELS)
    except LfcoreError as error:
        raise WorkflowError(str(error)) from None


onsuccess:
    progress.end()


onerror:
    progress.end(log)


include: "workflow/rules/common.smk"


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
include: "workflow/rules/true_picture.smk"
include: "workflow/rules/chosen_rays.smk"
include: "workflow/rules/assignment.smk"
include: "workflow/rules/sweep.smk"
include: "workflow/rules/report.smk"
