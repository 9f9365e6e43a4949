"""Dry runs: which jobs a configuration asks for, and what is refused before the first; and which
run again after a change, with the real job graph and scripts that write nothing but their outputs.
"""

import json
import re
import time

import pytest

pytestmark = pytest.mark.workflow

SMOKE = ("--configfile", "config/smoke.yaml")
TARGET = ("--", "results/tables/")
STORE_REPORTS = {
    "storage_layouts", "rate_distortion", "equivalence", "retrieval", "plenoptic_photograph",
    "other_renderers",
}  # fmt: skip


def test_the_default_run_has_a_row_for_each_scene_and_quick_tables_of_arrays(checkout):
    jobs = checkout.planned("--", "results/tables")
    assert jobs["join"] == 18 and jobs["chosen_rays_scene"] == jobs["work_precision_scene"] == 3
    # Large light fields are several jobs, so that two cores share them.
    assert jobs["trace"] > jobs["join"]
    assert set(jobs) >= STORE_REPORTS and jobs["retrieval_scene"] == jobs["equivalence_scene"] == 3
    # Of the assignment's scenes the large one is not traced for results/tables/.
    assert jobs["array_tables"] == jobs["assignment_reconstruction"] == 1
    assert jobs["assignment_trace"] == 2 and "assignment_see_through" not in jobs
    whole = checkout.planned("--", "results/assignment/")
    assert whole["assignment_trace"] == 3 and whole["assignment_tables"] == 1


def test_results_can_be_in_another_folder(checkout, tmp_path):
    there = ("--directory", str(tmp_path), "--", "results/bike/M128/N16/trace.json")
    assert checkout.planned(*there)["parse"] == 1
    (tmp_path / "config").mkdir()
    (tmp_path / "config/config.yaml").write_text("pixels: 32\n")
    assert checkout.planned(*there[:-1], there[-1].replace("M128", "M32"))["parse"] == 1


def test_what_is_not_asked_for_is_not_in_the_graph(checkout):
    jobs = checkout.planned(
        *SMOKE, "--config", "store=false", "scenes=[bike]",
        "reports=[quality, retrieval, equivalence]", *TARGET,
    )  # fmt: skip
    # What is not stored cannot be read.
    assert "retrieval" not in jobs and jobs["equivalence"] == jobs["equivalence_scene"] == 1
    assert {"retrieve", "viewer", "contact_sheets", "trace_stacks"}.isdisjoint(jobs)
    assert jobs["parse"] == 1
    only_views = checkout.planned(*SMOKE, "--config", "reports=[sub_aperture_views]", *TARGET)
    assert only_views["trace_stacks"] == only_views["contact_sheets"] == 3


def test_light_is_baked_for_a_scene_with_a_sky_alone(checkout, tmp_path):
    text = "objects: [{builder: chart}]\n"
    for name, more in (("dark", ""), ("bright", "sky: {colour: '#ffffff'}\n")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "scene.yaml").write_text(text + more)
        scenes = f"scenes=['{tmp_path / name}']"
        jobs = checkout.planned(
            *SMOKE, "--config", scenes, "--", f"results/{name}/M32/N4/trace.json"
        )
        assert jobs.get("bake", 0) == (name == "bright") and jobs["trace"] == 1


def test_any_key_can_be_overridden(checkout):
    jobs = checkout.planned(
        *SMOKE, "--config", "views=[16]", "tile_mib=1", "job_minutes=0.0001", "pixels=64",
        "layout={kind: macropixels, pack: 1}", "scenes=[cabin]", "reports=[chosen_rays]", *TARGET,
    )  # fmt: skip
    # One job for each tile: 1 MiB holds 21 of 64 rows of 64 macropixels of 16 x 16 rays.
    assert (jobs["trace"], jobs["join"]) == (4, 1)
    assert jobs["chosen_rays_scene"] == jobs["chosen_rays"] == 1


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("pixles=64", "pixles: unknown key. Did you mean 'pixels'"),
        ("pixels=abc", "pixels: 'abc' is not a value of this key"),
        ("layout={pack: 0}", "layout.pack: '0': must be greater than or equal to 1"),
        ("scenes=[nowhere]", "there is no scene 'nowhere'"),
        ("encoding={codec: libsvtav1, pixel_format: yuv444p}", "libsvtav1 does not take yuv444p"),
    ],
)
def test_impossible_configurations_stop_before_the_first_job(checkout, override, words):
    done = checkout.snakemake("--cores", "2", "--config", override, *TARGET)
    assert done.returncode != 0
    assert words in done.stdout
    assert not (checkout.folder / "results").exists()


def test_scenes_may_have_any_names(checkout, tmp_path):
    names = ["2024", "a b", "it's", "u\u0308ber"]
    for name in names:
        (tmp_path / name).mkdir()
        (tmp_path / name / "scene.yaml").write_text("objects: [{builder: chart}]\n")
    scenes = json.dumps([str(tmp_path / name) for name in names])
    jobs = checkout.planned(*SMOKE, "--config", f"scenes={scenes}", *TARGET)
    assert jobs["parse"] == len(names) and jobs["page"] == 1


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
        kept = script.read_text()  # for its imports
        script.write_text(
            f"{PRETEND}open('ran', 'a').write({script.name!r} + '\\n')\nexit()\n{kept}"
        )
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


def test_the_smallest_run_has_every_rule_and_script_and_a_second_nothing_to_do(made):
    assert again(made, "--", TABLES, ASSIGNMENT) == {}
    # Sweeps, skies, films and data sets have rules that this run does not need.
    listed = made.snakemake(*MICRO, "--list-rules").stdout.splitlines()
    targets = {"tables", "assignment"}
    rules = {rule for rule in listed if re.fullmatch(r"\w+", rule)} - targets
    assert "trace" in rules and rules - {"bake", "misspelt"} <= made.scripts
    scripts = {file.name for file in (made.folder / "workflow" / "scripts").glob("*.py")}
    ran = set((made.folder / "ran").read_text().split())
    elsewhere = {"dataset.py", "dataset_batch.py", "dataset_sources.py"}
    elsewhere |= {"film_ahead.py", "film_instants.py", "film.py"}
    assert scripts - ran == elsewhere | {"sweep_group.py", "sweep_table.py"}


@pytest.mark.parametrize(
    ("old", "new", "rules"),
    [
        ("qualities_db: [25]", "qualities_db: [30]", {"chosen_rays_scene", "chosen_rays"}),
        ("rays: 400 ", "rays: 500 ", {"stability"}),
        ("views: 2\n", "views: 3\n", {"other_renderers"}),
        ("instants: 2", "instants: 3", set()),
    ],
)
def test_a_constant_of_a_study_runs_again_who_reads_it_and_nothing_else(made, old, new, rules):
    records = made.folder / "workflow/reports.yaml"
    text = records.read_text()
    try:
        records.write_text(text.replace(old, new))
        assert text.count(old) == 1
        assert again(made, "--", TABLES) == dict.fromkeys(rules | {"page"}, 1)
    finally:
        records.write_text(text)


@pytest.mark.parametrize(
    "override",
    [
        "encoding={codec: libsvtav1, pixel_format: yuv444p}",
        "dataset={name: x, kind: focal_stacks, shapes: {meshes: nowhere}}",
    ],
)
def test_what_is_impossible_is_refused_where_results_are_already_there(made, override):
    done = made.snakemake("--cores", "1", *MICRO, "--config", override, "--", TABLES)
    assert done.returncode and "Traceback" not in done.stdout


def test_the_style_of_a_page_runs_the_pages_again(made):
    style = made.folder / "lfcore/evaluation/page.css"
    text = style.read_text()
    try:
        style.write_text(text + "p {}\n")
        assert again(made, "--", TABLES, ASSIGNMENT) == {"page": 1, "assignment_page": 1}
    finally:
        style.write_text(text)


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
