# The checked configuration, and functions of all stages. The library is imported where jobs are
# planned, so that the workflow can be parsed without it.
import json
import os
import re
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from snakemake.exceptions import WorkflowError

# Jobs end with this process; see lfcore/workflow/job.py.
os.environ.update(LFCORE_RUN=str(os.getpid()))
# Where environments of rules find the library; see workflow/envs/lfcore.post-deploy.sh.
library = find_spec("lfcore")
if library:
    os.environ.setdefault("LFCORE_ROOT", str(Path(library.origin).parents[1]))
# Jobs keep to their threads: those of BLAS would spin while they wait for one another.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# The thesis's tables and pictures come first, then long studies, so that the cores finish together.
FIRST, LONG = 20, 10
CHART = "chart"  # the scene of the plenoptic photograph and of other renderers


def read(value):
    """Numbers within lists and mappings of --config, which Snakemake leaves as text."""
    if isinstance(value, dict):
        return {name: read(one) for name, one in value.items()}
    if isinstance(value, list):
        return [read(one) for one in value]
    try:
        return json.loads(value) if isinstance(value, str) else value
    except ValueError:
        return value


config.update(read(config))
try:
    validate(config, "../schemas/config.schema.yaml")
except WorkflowError as error:
    wrong = error.__context__
    meaning = wrong.schema.get("description", "the keys are in config/README.md")
    place = wrong.json_path.removeprefix("$").removeprefix(".") or "configuration"
    raise WorkflowError(f"{place}: {wrong.message[:200]} ({meaning})") from None


def scene_name(entry):
    """The name of a scene's folder of results: of its folder, or of its file."""
    file = Path(entry)
    if file.name == "scene.yaml":
        return file.resolve().parent.name
    return file.stem if file.is_file() else file.name


SCENES = list(map(scene_name, config["scenes"]))
WIDTH, HEIGHT = (int(str(config["pixels"]).split("x")[side]) for side in (0, -1))
PIXELS = config["pixels"] = WIDTH if WIDTH == HEIGHT else f"{WIDTH}x{HEIGHT}"
VIEWS = sorted(config["views"])
STORE = config["store"]
REPORTS = set(config["reports"])
DEVICE = config["device"]
# A folder for each size of pictures: runs of different sizes are side by side.
SLAB = f"results/{{scene}}/M{PIXELS}/N{{n}}"
# Light fields whose tracing takes less than a job, at 100 ns per ray, are one submission to a
# cluster per scene. On one machine groups mean nothing.
SMALL = sum(n**2 for n in VIEWS) * WIDTH * HEIGHT * 100e-9 <= 60 * config["job_minutes"]
TRACE_GROUP = "scene_{scene}" if SMALL else None
REPORT_GROUP = "report"


wildcard_constraints:
    scene=r"[\w+-][\w.+-]*",
    n=r"\d+",
    batch=r"\d{4}",


def version(stage):
    """The version of a stage's code, as a param: an edit runs the stage again."""

    def planned(wildcards):
        from lfcore.workflow.versions import version

        return version(stage)

    return planned


def of_settings(*keys):
    """Keys of the configuration as params: each rule has those alone that it reads."""
    return {key: config[key] for key in keys}


def file_of_scene(name):
    """The file of a scene of this name."""
    from lfcore.workflow.cases import scene_file

    entries = [config["scenes"], config["assignment"]["scenes"]]
    if config["sweep"]:
        entries.append(planned_sweep().scenes)
    return scene_file(name, *entries)


def scene_inputs(wildcards):
    """The scene's file, and all files that it names: an edit of any parses it anew."""
    from lfcore.readers.sources import files_of_scene

    return [local(str(file)) for file in files_of_scene(file_of_scene(wildcards.scene))]


def moving_sphere(wildcards):
    from lfcore.readers.sources import files_of_scene
    from lfcore.workflow.cases import ROOT

    return [local(str(file)) for file in files_of_scene(ROOT / "scenes/sphere/moving.pbrt")]


def book_lens(wildcards):
    from lfcore.workflow.cases import ROOT

    return local(str(ROOT / "scenes/lenses/double_gauss.dat"))


def grouped(stage):
    return "scene_{scene}" if SMALL else f"{stage}_{{scene}}"


def batches(wildcards):
    """The tracing jobs of a light field by name."""
    from lfcore.workflow.costs import named_batches

    return named_batches(config, int(wildcards.n))


def batch_of(wildcards):
    return batches(wildcards)[wildcards.batch]


def of_batches(suffix):
    """Input function: the file with this suffix of each batch of tiles of a light field."""
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


def sums_mib(wildcards, attempt):
    from lfcore.workflow import costs

    return costs.sums_mib(PIXELS) * attempt


@cache
def planned_sweep():
    """The light fields of the table that the configuration names."""
    from lfcore.workflow.sweep import plan

    return plan(Path(config["sweep"]), config)


def sweep_files(pattern):
    """Input function: this file of every tracing of the sweep."""
    return lambda wildcards: [
        pattern.format(group=group, scene=scene, n=n) for group, scene, n in planned_sweep().members
    ]


def of_resolutions(file):
    """This file of a scene for every number of views, ascending."""
    return expand(f"{SLAB}/{file}", n=VIEWS, allow_missing=True)


def by_name(*files):
    """These files of a scene for every number of views, by name."""
    return {Path(file).stem: of_resolutions(file) for file in files}


TRACED = by_name("planes/on_the_fly.npz", "trace.json")
STORED = by_name("planes/from_video.npz", "store.json", "retrieve.json") if STORE else {}


def of_scenes(file):
    """This file of every scene of the tables."""
    return [f"results/{scene}/{file}" for scene in SCENES]


def of_scene(name):
    """The files with a scene's arrays in camera space, its tree and, if any, its baked light."""

    def light(wildcards):
        from lfcore.readers.sources import asks_for_light

        scene = name.format(**wildcards)
        return [f"results/{scene}/light.npz"] if asks_for_light(file_of_scene(scene)) else []

    return {
        "scene": f"results/{name}/scene.npz",
        "bvh": f"results/{name}/bvh.npz",
        "light": light,
    }


def captions(*names):
    """The texts of captions, as a param: a function, since texts with braces are no patterns."""
    texts = [Path(workflow.source_path(f"../report/{one}.rst")).read_text("utf-8") for one in names]
    return lambda wildcards: texts


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


DATASET = config["dataset"]
DATASET_FOLDER = f"results/datasets/{DATASET.get('name', '')}"


@cache
def dataset():
    """The checked description; the disk must have room for what it asks for."""
    from lfcore.datasets.description import Description

    found = Description.check(DATASET)
    found.check_room(Path("."))
    return found


def dataset_files(suffix):
    """Input function: this file of every batch."""
    pattern = f"{DATASET_FOLDER}/batches/{{batch}}.{suffix}"
    return lambda wildcards: [pattern.format(batch=batch) for batch in dataset().batches()]


def dataset_scenes(wildcards):
    found = dataset().scenes_of(wildcards.batch)
    return [found.start, found.stop]


def dataset_sources(wildcards):
    found = dataset()
    return [str(file) for file in (*found.mesh_files(), *found.texture_files())]
