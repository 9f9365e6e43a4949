"""The micro data set by the workflow: as readers want it, the same by any number of jobs."""

import csv
import json

import pytest

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
    assert "Gaussian blur by layers" in page and page.count("data:image/png") == 3


def test_nothing_is_to_be_done_twice_and_one_job_makes_the_same_bytes(made):
    assert made.planned(*MICRO, *TARGET) == {}
    folder = made.folder / "results/datasets/micro"
    first = files(folder / "data") | {"items": (folder / "items.csv").read_bytes()}
    made.made(*MICRO, "--config", "dataset={scenes_per_job: 4}", "--forceall", *TARGET)
    assert files(folder / "data") | {"items": (folder / "items.csv").read_bytes()} == first


def test_a_mistake_stops_before_the_first_job(made):
    done = made.snakemake(
        "--cores", "2", *MICRO, "--config", "dataset={placement: {size: [2, 1]}}", *TARGET
    )
    assert done.returncode and "upside down: 2 is above 1" in done.stdout
