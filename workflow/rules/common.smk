# The checked configuration, and what all stages ask of it. Rules are in the other files.
import os
import re

from snakemake.settings.types import SharedFSUsage

from lfcore.scene.sources import files_of_scene
from lfcore.workflow import cases, costs, reports, sources, sweep
from lfcore.workflow.settings import check_settings
from lfcore.workflow.sources import digest

# Where a rule's own environment finds the library; see workflow/envs/lfcore.post-deploy.sh.
os.environ.update(LFCORE_ROOT=str(ROOT))
# Jobs keep to their threads: those of BLAS would wait for one another by spinning.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# What the plenoptic photograph and other renderers show, whatever scenes are in tables.
CHART = "chart"

try:
    SETTINGS = check_settings(config)
    SCENES = cases.scene_files(SETTINGS["scenes"], ROOT)
    SWEEP = sweep.plan(Path(SETTINGS["sweep"]), config, ROOT) if SETTINGS["sweep"] else None
    FIGURE_SCENES = cases.scene_files([CHART], ROOT)
    ASSIGNMENT_SCENES = cases.scene_files(SETTINGS["assignment"]["scenes"], ROOT)
    BATCHES = {
        views: costs.named_batches(SETTINGS, views) for views in SETTINGS["angular_resolutions"]
    }
except LfcoreError as error:
    raise WorkflowError(str(error)) from None

# What can be parsed: the tables' scenes, and figures' and the assignment's whether in tables or not.
PARSED = {**FIGURE_SCENES, **ASSIGNMENT_SCENES, **SCENES}
if SWEEP:
    PARSED |= cases.scene_files(SWEEP.scenes, ROOT)
STORE = SETTINGS["store"]
PIXELS = SETTINGS["spatial_resolution"]
RESOLUTIONS = sorted(SETTINGS["angular_resolutions"])
# A folder of its own for each size: runs of unlike M lie side by side.
SLAB = f"results/{{scene}}/M{PIXELS}/N{{n}}"
TABLE_SECTIONS = reports.table_sections(SETTINGS, SCENES)


wildcard_constraints:
    scene="|".join(map(re.escape, PARSED)),
    n=r"\d+",
    batch=r"\d{4}",


def of_settings(*keys):
    """Keys of the configuration as params: a rule has those alone that it reads."""
    return {key: SETTINGS[key] for key in keys}


def scene_inputs(wildcards):
    """The scene's file, and all that it is made from: an edit of any parses it anew."""
    return [local(str(file)) for file in files_of_scene(PARSED[wildcards.scene])]


def scene_sources(wildcards):
    procedural = ["scene/procedural"] if cases.is_procedural(PARSED[wildcards.scene]) else []
    return digest(*sources.PARSING, *procedural)


# Where all tracing of a scene is less than a job, the scene is one submission to a cluster; else its
# stages are, and each batch of tiles.  On one machine groups mean nothing.
SMALL = costs.small(SETTINGS["job_minutes"], BATCHES)
TRACE_GROUP = "scene_{scene}" if SMALL else None
REPORT_GROUP = "report"
SHARED = workflow.storage_settings.shared_fs_usage


def grouped(stage):
    return "scene_{scene}" if SMALL else f"{stage}_{{scene}}"


def at_home(group):
    """The group of jobs that read files of the project.  Nodes that share no folder lack them:
    then these run where the workflow was started, and so would all of their group."""
    return group if SharedFSUsage.INPUT_OUTPUT in SHARED else None


def batch_of(wildcards):
    return BATCHES[int(wildcards.n)][wildcards.batch]


def traced_before(wildcards):
    return costs.traced_before("results", wildcards.scene, int(wildcards.n))


def of_batches(suffix):
    """Input function: one file with this suffix for each batch of tiles of a scene and N."""
    return lambda wildcards: expand(
        f"{SLAB}/tiles/{{batch}}{suffix}",
        scene=wildcards.scene,
        n=wildcards.n,
        batch=BATCHES[int(wildcards.n)],
    )


def of_resolutions(file):
    """This file of a scene at every N, ascending."""
    return expand(f"{SLAB}/{file}", n=RESOLUTIONS, allow_missing=True)


def of_scenes(file):
    """This file of every scene of the tables."""
    return [f"results/{scene}/{file}" for scene in SCENES]


def of_scene(name):
    """Files of a scene's arrays in camera space and its tree."""
    return {"scene": f"results/{name}/scene.npz", "bvh": f"results/{name}/bvh.npz"}


def caption_of(name):
    return local(str(ROOT / "workflow" / "report" / f"{name}.rst"))


def shown(file, caption, category, **labels):
    """A file, as Snakemake's own report shows it."""
    caption = f"../report/{caption}.rst"
    return report(file, caption=caption, category=category, labels=labels or None)


def table(name):
    return shown(f"results/tables/{name}.csv", name, "Tables")


def figure(name, file, scene):
    file = f"results/tables/figures/{file}.png"
    return shown(file, name, "Figures", figure=name, scene=scene)


def assignment_figure(name):
    file, label = f"results/assignment/figures/{name}.png", name.replace("_", " ")
    return shown(file, "assignment_figure", "Assignment", figure=label)
