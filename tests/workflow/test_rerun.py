"""What runs again after a change, in a run whose scripts write nothing but their outputs.

The job graph, its params and its bookkeeping are the real ones.
"""

import re
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.workflow

ROOT = Path(__file__).resolve().parents[2]
MICRO = ("--configfile", "config/micro.yaml")
TABLES, ASSIGNMENT = "results/tables/", "results/assignment/"
PRETEND = """
from pathlib import Path
for file in map(Path, snakemake.output):
    folder = file.name in ("on_the_fly", "from_video", "planes")
    file.mkdir(parents=True, exist_ok=True) if folder else file.write_text("made")
"""
OBJ = "mtllib cube.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n"


@pytest.fixture(scope="module")
def made(project_copy):
    """A checkout in which everything has been made, by scripts that pretend."""
    checkout = project_copy("rerun")
    for script in (checkout.folder / "workflow" / "scripts").glob("*.py"):
        script.write_text(f"{PRETEND}open('ran', 'a').write({script.name!r} + '\\n')\n")
    mesh = checkout.folder / "mesh"
    mesh.mkdir()
    (mesh / "cube.obj").write_text(OBJ)
    (mesh / "cube.mtl").write_text("newmtl m\nmap_Kd wood.png\n")
    (mesh / "wood.png").write_bytes(b"not looked at")
    done = checkout.snakemake("--cores", "2", *MICRO, "--", TABLES, ASSIGNMENT)
    assert done.returncode == 0, done.stdout[-3000:]
    checkout.scripts = set(re.findall(r"rule (\w+):", done.stdout))
    return checkout


def again(checkout, *arguments):
    """Rules that would run again, without the targets."""
    jobs = checkout.planned(*MICRO, *arguments)
    return {rule: count for rule, count in jobs.items() if not rule.startswith("results/")}


def test_a_second_run_has_nothing_to_do(made):
    assert again(made, "--", TABLES, ASSIGNMENT) == {}


def test_the_smallest_run_has_every_rule_and_script(made):
    """But for those of sweeps, skies and data sets."""
    listed = made.snakemake(*MICRO, "--list-rules").stdout.splitlines()
    targets = {"tables", "assignment"}
    rules = {rule for rule in listed if re.fullmatch(r"\w+", rule)} - targets
    assert "trace" in rules and rules - {"bake"} <= made.scripts
    scripts = {file.name for file in (made.folder / "workflow" / "scripts").glob("*.py")}
    ran = set((made.folder / "ran").read_text().split())
    elsewhere = {"dataset.py", "dataset_batch.py"}
    assert scripts - ran == elsewhere | {"sweep_group.py", "sweep_table.py"}


@pytest.mark.parametrize(
    ("override", "rules"),
    [
        (
            "analysis={chosen_rays: {qualities_db: [30]}}",
            {"chosen_rays_scene": 1, "chosen_rays": 1, "page": 1},
        ),
        ("analysis={stability_rays: 500}", {"stability": 1, "page": 1}),
        ("figures={renderers: {views: 3}}", {"other_renderers": 1, "page": 1}),
        ("assignment={instants: 3}", {"page": 1}),
    ],
)
def test_a_key_runs_again_who_reads_it_and_nothing_else(made, override, rules):
    assert again(made, "--config", override, "--", TABLES) == rules


def test_what_only_words_a_caption_measures_nothing(made):
    caption = made.folder / "workflow" / "report" / "stability.rst"
    text = caption.read_text()
    try:
        time.sleep(1.1)
        caption.write_text(text + "More.\n")
        assert again(made, "--", TABLES) == {"page": 1}
    finally:
        caption.write_text(text)
        made.snakemake("--cores", "2", *MICRO, "--", TABLES)


def test_an_edited_texture_that_an_mtl_names_runs_the_parse_again(made):
    target = ("--config", "scenes=[mesh/cube.obj]", "--", "results/cube/bvh.npz")
    assert made.snakemake("--cores", "1", *MICRO, *target).returncode == 0
    assert again(made, *target) == {}
    time.sleep(1.1)
    (made.folder / "mesh" / "wood.png").write_bytes(b"other wood")
    assert again(made, *target) == {"parse": 1, "build": 1}
