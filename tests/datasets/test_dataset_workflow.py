"""The micro data set by the workflow: as readers want it, the same by any number of jobs."""

import csv
import json
import re
import shutil

import pytest

import lfcore
from tests.workflow.conftest import checkout_in

pytestmark = pytest.mark.workflow
MICRO = ("--configfile", "config/datasets/micro.yaml")
TARGET = ("--", "results/datasets/micro/")


def files(folder):
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("[0-9]*")}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    copy = checkout_in(tmp_path_factory.mktemp("datasets"))
    jobs = copy.made(*MICRO, *TARGET)
    assert jobs["dataset_batch"] == 2 and jobs["dataset"] == 1
    return copy


def test_the_folder_is_that_of_fod500_with_card_and_page(made):
    folder = made.folder / "results/datasets/micro"
    names = {path.name for path in (folder / "data").glob("[0-9]*")}
    assert {f"000003_{k:02d}All.tif" for k in range(5)} | {"000003Dpt.exr"} <= names
    rows = list(csv.DictReader((folder / "items.csv").open()))
    assert [row["split"] for row in rows] == ["train", "train", "train", "validation"]
    assert all(float(row["expected_db"]) >= 30 for row in rows)
    listed = {row["file"] for row in csv.DictReader((folder / "files.csv").open())}
    assert listed == names
    card = json.loads((folder / "croissant.json").read_text())
    assert {one["@type"] for one in card["distribution"]} == {"cr:FileObject", "cr:FileSet"}
    page = (folder / "index.html").read_text()
    assert page.count("data:image/png") == 2


def test_nothing_is_to_be_done_twice_and_one_job_makes_the_same_bytes(made):
    assert made.planned(*MICRO, *TARGET) == {}
    folder = made.folder / "results/datasets/micro"
    first = files(folder / "data") | {"items": (folder / "items.csv").read_bytes()}
    made.made(*MICRO, "--config", "dataset={scenes_per_job: 4}", "--forceall", *TARGET)
    assert files(folder / "data") | {"items": (folder / "items.csv").read_bytes()} == first


def whole(folder):
    return {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("{placement: {size: [2, 1]}}", "2 is above 1"),
        ("{shapes: {meshes: nowhere}}", "nowhere: shapes.meshes: no such file or folder"),
        ("{materials: {textures: scenes}}", "materials.textures: has none of"),
        ("{qualty_db: 30}", "qualty_db: unknown key. Did you mean 'quality_db'"),
        ("{quality_db: 100}", "4 of 4 scenes made no item"),
    ],
)
def test_a_run_that_fails_leaves_the_finished_set(made, change, words):
    before = whole(made.folder / "results/datasets/micro")
    done = made.snakemake("--cores", "2", *MICRO, "--config", f"dataset={change}", *TARGET)
    assert done.returncode and words in done.stdout, done.stdout[-2000:]
    after = whole(made.folder / "results/datasets/micro")
    assert {path: after.get(path) for path in before} == before


def test_a_failed_job_asks_for_more(made):
    asked = []
    for scenes in (1, 32):
        change = f"dataset={{pixels: 512, scenes: {{train: {scenes}, validation: 0}}, "
        change += "scenes_per_job: 32}"
        words = ("--config", "device=nosuch", change, "--retries", "1", "--until", "dataset_batch")
        done = made.snakemake("--cores", "2", *MICRO, *words, *TARGET)
        assert done.returncode
        asked.append([*map(int, re.findall(r"runtime=(\d+)", done.stdout))])
        assert {"mem_mb=3000", "mem_mb=6000"} <= set(re.findall(r"mem_mb=\d+", done.stdout))
    (few, twice), (many, _) = (sorted({*times})[-2:] for times in asked)
    assert twice == 2 * few and many > 10 * few


def test_more_scenes_another_licence_and_an_edited_page_make_no_item_again(made):
    """Planted seconds stay where nothing was made."""
    folder = made.folder / "results/datasets/micro"
    made.made(*MICRO, *TARGET)  # after other tests
    seconds = folder / "seconds.csv"
    planted = re.sub(r"(?m)^(\d),[\d.]+", r"\1,123.0", seconds.read_text())
    seconds.write_text(planted)
    page = made.folder / "lfcore/datasets/card.py"
    page.write_text(page.read_text().replace("What training sees.", "What they see."))
    change = "dataset={licence: CC0, scenes: {train: 4}}"
    made.made(*MICRO, "--config", change, *TARGET)
    lines = planted.splitlines()
    assert seconds.read_text().splitlines()[: len(lines)] == lines
    assert len((folder / "items.csv").read_text().splitlines()) == 6
    assert json.loads((folder / "croissant.json").read_text())["license"] == "CC0"
    record = json.loads((folder / "data/000003.json").read_text())
    assert record["split"] == "train"  # it was for validation


def test_the_library_makes_the_same_set_and_keeps_the_workflows_items(made, tmp_path):
    folder = made.folder / "results/datasets/micro"
    made.made(*MICRO, *TARGET)  # after other tests
    copy = tmp_path / "micro"
    shutil.copytree(folder, copy)
    lfcore.make_dataset(copy / "description.yaml", copy)
    assert files(copy / "data") == files(folder / "data")
    assert (copy / "seconds.csv").read_bytes() == (folder / "seconds.csv").read_bytes()
