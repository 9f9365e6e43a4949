# From scenes to tables: see README.md for the two commands, config/README.md for every key, and
# docs/architecture.md for how data flows.
import logging
from pathlib import Path

from snakemake.exceptions import WorkflowError
from snakemake.jobs import GroupJob
from snakemake.utils import min_version

from lfcore.errors import LfcoreError
from lfcore.workflow import progress
from lfcore.workflow.cluster import check_bucket, check_folder, check_partitions, partitions_of
from lfcore.workflow.run import hold, say_why_groups_fail, schedule_when_jobs_end

min_version("9.0")
progress.hush(workflow)

if workflow.is_main_process:
    try:
        check_folder("")
        check_bucket(
            workflow.storage_registry.default_storage_provider,
            workflow.storage_settings.default_storage_prefix,
        )
    except LfcoreError as error:
        logging.raiseExceptions = False  # where the disk is full, its log file is, too
        raise WorkflowError(str(error)) from None

# Of this file, also where another workflow takes it as a module.
ROOT = Path(workflow.current_basedir.get_path_or_uri(secret_free=False))


configfile: ROOT / "config" / "config.yaml"


report: "workflow/report/workflow.rst"


# Jobs of this run end with it, however that is; see lfcore/workflow/run.py.
onstart:
    hold()
    schedule_when_jobs_end(workflow)
    say_why_groups_fail(GroupJob, workflow.logger_manager.logger)
    try:
        check_partitions(partitions_of(workflow.dag.needrun_jobs()))
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
