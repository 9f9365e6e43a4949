# The checked configuration, and what all stages ask of it. Rules are in the other files.
import sys
from pathlib import Path

from snakemake.exceptions import WorkflowError

ROOT = Path(workflow.basedir)
sys.path.insert(0, str(ROOT))

from lfcore.errors import LfcoreError
from lfcore.scene.sources import files_of_scene
from workflow import cases
from workflow.assignment import ARRAYS as ASSIGNMENT_ARRAYS
from workflow.run import hold
from workflow.settings import check_settings
from workflow.sources import source_digest

# What the plenoptic photograph and other renderers show, whatever scenes are in tables.
CHART = "chart"

try:
    SETTINGS = check_settings(config)
    SCENES = cases.scene_files(SETTINGS["scenes"], ROOT)
    FIGURE_SCENES = cases.scene_files([CHART], ROOT)
    ASSIGNMENT_SCENES = cases.scene_files(ASSIGNMENT_ARRAYS, ROOT)
    TILES = {views: cases.tile_names(SETTINGS, views) for views in SETTINGS["angular_resolutions"]}
except LfcoreError as error:
    raise WorkflowError(str(error)) from None

# What can be parsed: the tables' scenes, and figures' and the assignment's whether in tables or not.
PARSED = {**FIGURE_SCENES, **ASSIGNMENT_SCENES, **SCENES}
STORE = SETTINGS["store"]
RESOLUTIONS = sorted(SETTINGS["angular_resolutions"])
# What the page shows, in order: {name: {"title": ..., "table": bool, "figures": {label: file}}}.
# Each stage adds its own; captions are in workflow/report/<name>.rst.
SECTIONS = {}


wildcard_constraints:
    scene="|".join(map(re.escape, PARSED)),
    n=r"\d+",
    tile=r"\d{4}",


def sources(script, *more):
    """Digest of what a script imports: without it in params, an edit would re-run nothing."""
    return source_digest(ROOT / "workflow" / "scripts" / script, ROOT, *more)


# A scene depends on the builders that it names, and on no others.
SCENE_SOURCES = {
    scene: sources("parse.py", *cases.builders_of_scene(file, ROOT))
    for scene, file in PARSED.items()
}


def scene_inputs(wildcards):
    return list(map(str, files_of_scene(PARSED[wildcards.scene])))


def of_tiles(suffix):
    """Input function: one file with this suffix for each tile of a scene and N."""
    return lambda wildcards: [
        f"results/{wildcards.scene}/N{wildcards.n}/tiles/{tile}{suffix}"
        for tile in TILES[int(wildcards.n)]
    ]


def of_resolutions(file):
    """This file of a scene at every N, ascending."""
    return [f"results/{{scene}}/N{views}/{file}" for views in RESOLUTIONS]


def wanted(figure):
    return figure in SETTINGS["figures"]["make"]


def of_scenes(file):
    """This file of every scene of the tables."""
    return [f"results/{scene}/{file}" for scene in SCENES]


def caption_of(name):
    return f"{workflow.basedir}/workflow/report/{name}.rst"


def assignment_figure(name):
    """A figure's file, as Snakemake's own report shows it."""
    return report(
        f"results/assignment/figures/{name}.png",
        caption="../report/assignment_figure.rst",
        category="Assignment",
        labels={"figure": name.replace("_", " ")},
    )
