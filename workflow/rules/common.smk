# The checked configuration, and functions of all stages.
import json
import os
import re
from importlib.util import find_spec
from pathlib import Path

import yaml
from snakemake.exceptions import WorkflowError

# Jobs end with this process; see lfcore/workflow/job.py.
os.environ.update(LFCORE_RUN=str(os.getpid()))
# Where environments of rules find the library; see workflow/envs/lfcore.post-deploy.sh.
library = find_spec("lfcore")
if library:
    os.environ.setdefault("LFCORE_ROOT", str(Path(library.origin).parents[1]))
# The project's scenes are beside the workflow; a wheel of the library has none.
if (scenes := Path(str(workflow.current_basedir)).parents[1] / "scenes").is_dir():
    os.environ.setdefault("LFCORE_SCENES", str(scenes))
# Jobs keep to their threads: BLAS's would spin while they wait for one another.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# The thesis's tables and pictures are first, then long studies, so that all cores finish together.
FIRST, LONG = 20, 10
CHART = "chart"  # the scene of the plenoptic photograph and of other renderers


def read(value):
    """Convert numbers in lists and mappings of --config, which Snakemake leaves as text."""
    if isinstance(value, dict):
        return {name: read(item) for name, item in value.items()}
    if isinstance(value, list):
        return [read(item) for item in value]
    try:
        return json.loads(value) if isinstance(value, str) else value
    except ValueError:
        return value


# The measurements and their presentation: see the file.
with open(workflow.source_path("../reports.yaml"), encoding="utf-8") as file:
    REPORT_RECORDS = yaml.safe_load(file)
THESIS_TABLES = [name for name in REPORT_RECORDS if name.startswith("table_7_")]
# The names in the key `reports`; quality: curves of the thesis's tables.
KNOWN_REPORTS = {record.get("with", name): None for name, record in REPORT_RECORDS.items()} | {
    "quality": None
}
for name in THESIS_TABLES:
    del KNOWN_REPORTS[name]


def checked_plan():
    """Return the configuration's plan; None without lfcore, for `snakemake --lint`."""
    try:
        from lfcore.errors import LfcoreError
        from lfcore.workflow.plan import Plan
    except ImportError:
        return None
    try:
        return Plan.of(config, KNOWN_REPORTS, first=workflow.is_main_process)
    except LfcoreError as error:
        raise WorkflowError(str(error)) from None


config.update(read(config))
PLAN = checked_plan()
if PLAN:
    config.update(PLAN.settings)
else:
    validate(config, "../schemas/config.schema.yaml")

SCENES = list(PLAN.scenes) if PLAN else config["scenes"]
WIDTH, HEIGHT = (int(str(config["pixels"]).split("x")[side]) for side in (0, -1))
PIXELS = config["pixels"] = WIDTH if WIDTH == HEIGHT else f"{WIDTH}x{HEIGHT}"
VIEWS = sorted(config["views"])
STORE = config["store"]
REPORTS = set(KNOWN_REPORTS if config["reports"] == "all" else config["reports"])
# The constants of each report's study; captions read them, too.
SETTINGS = config["settings"] = {
    name: record["settings"]["default"] | record["settings"].get(config["studies"], {})
    for name, record in REPORT_RECORDS.items()
    if "settings" in record
}
DEVICE = config["device"]
# Each size of pictures has its folder.
SLAB = f"results/{{scene}}/M{PIXELS}/N{{n}}"
# If tracing takes less than a job, at 100 ns per ray, each scene is one submission to a cluster.
# On one machine groups have no effect.
SMALL = sum(n**2 for n in VIEWS) * WIDTH * HEIGHT * 100e-9 <= 60 * config["job_minutes"]
TRACE_GROUP = "scene_{scene}" if SMALL else None
REPORT_GROUP = "report"


wildcard_constraints:
    scene=r"[\w+-][\w.+-]*",
    n=r"\d+",
    batch=r"\d{4}",


def version(script):
    """Return the version of a script's code as a param: an edit runs the script again."""
    file = Path(workflow.source_path(f"../scripts/{script}.py"))

    def planned(wildcards):
        from lfcore.versions import version

        return version(file)

    return planned


def of_settings(*keys):
    """Return keys of the configuration as params: each rule has only those that it reads."""
    return {key: config[key] for key in keys}


def scene_inputs(wildcards):
    """Return the scene's file, and all files that it names: an edit of any parses it again."""
    return local_files(PLAN.files[wildcards.scene])


def local_files(scene):
    from lfcore.readers.sources import files_of_scene

    return [local(str(file)) for file in files_of_scene(scene)]


def moving_sphere(wildcards):
    from lfcore.workflow.cases import scenes_folder

    return local_files(scenes_folder() / "sphere/moving.pbrt")


def book_lens(wildcards):
    from lfcore.workflow.cases import scenes_folder

    return local(str(scenes_folder() / "lenses/double_gauss.dat"))


def grouped(stage):
    return "scene_{scene}" if SMALL else f"{stage}_{{scene}}"


def batches(wildcards):
    """Return the tracing jobs of a light field by name."""
    from lfcore.workflow.costs import named_batches

    return named_batches(config, int(wildcards.n))


def batch_of(wildcards):
    return batches(wildcards)[wildcards.batch]


def of_batches(suffix):
    """Return an input function: the file with this suffix of each batch of a light field."""
    return lambda wildcards: expand(
        f"{SLAB}/tiles/{{batch}}{suffix}",
        scene=wildcards.scene,
        n=wildcards.n,
        batch=batches(wildcards),
    )


def trace_minutes(wildcards, attempt):
    from lfcore.workflow import costs

    return costs.trace_minutes(batch_of(wildcards).rays, int(wildcards.n)) * attempt


def trace_mib(wildcards, input, attempt):
    from lfcore.workflow import costs

    return costs.trace_mib(input.size_mb, PIXELS) * attempt


def set_minutes(wildcards, attempt):
    """Minutes for a batch of a data set."""
    from lfcore.workflow import costs

    pictures = len(PLAN.dataset.scenes_of(wildcards.batch)) * PLAN.dataset.frames.count
    return costs.items_minutes(pictures, PLAN.dataset.pixels) * attempt


def groups_of_film():
    """Return the names of the jobs of a film."""
    from lfcore.storage.instants import GROUP

    return [f"{first // GROUP:05d}" for first in range(0, config["film"]["frames"], GROUP)]


def film_minutes(wildcards, attempt):
    """Minutes for a group of instants."""
    from lfcore.workflow import costs

    return costs.film_minutes(PIXELS) * attempt


def sums_mib(wildcards, attempt):
    from lfcore.workflow import costs

    return costs.sums_mib(PIXELS) * attempt


def sweep_files(pattern):
    """Return an input function: this file of every tracing of the sweep."""
    return lambda wildcards: [
        pattern.format(group=group, scene=scene, n=n) for group, scene, n in PLAN.sweep.members
    ]


def of_resolutions(file):
    """Return this file of a scene for every number of views, ascending."""
    return expand(f"{SLAB}/{file}", n=VIEWS, allow_missing=True)


def by_name(*files):
    """Return these files of a scene for every number of views, by name."""
    return {Path(file).stem: of_resolutions(file) for file in files}


TRACED = by_name("planes/on_the_fly.npz", "trace.json")
STORED = by_name("planes/from_video.npz", "store.json", "retrieve.json") if STORE else {}


def of_scenes(file):
    """Return this file of every scene in the tables."""
    return [f"results/{scene}/{file}" for scene in SCENES]


def of_scene(name):
    """Return the files of a scene's arrays in camera space, its hierarchy and its baked light."""

    def light(wildcards):
        from lfcore.readers.sources import asks_for_light

        scene = name.format(**wildcards)
        return [f"results/{scene}/light.npz"] if asks_for_light(PLAN.files[scene]) else []

    return {
        "scene": f"results/{name}/scene.npz",
        "bvh": f"results/{name}/bvh.npz",
        "light": light,
    }


def captions(*names):
    """Return the texts of captions as a param: a function, since texts may have braces."""
    texts = [Path(workflow.source_path(f"../report/{n}.rst")).read_text("utf-8") for n in names]
    return lambda wildcards: texts


def shown(file, caption, category, **labels):
    """Return a file that is in Snakemake's report."""
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


def no_target(wildcards):
    """Refuse a misspelt target of the command line."""
    from lfcore.errors import did_you_mean

    keys = {"sweep": "sweep", "dataset": "dataset", "films": "film.frames"}
    remedy = did_you_mean(wildcards.target, ["tables", "assignment", *keys])
    if wildcards.target in keys:
        remedy = f"It needs the key {keys[wildcards.target]}"
    raise WorkflowError(f"There is no target {wildcards.target!r}. {remedy}.")
