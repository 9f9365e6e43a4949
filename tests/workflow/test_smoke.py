"""The smoke run itself, once; then what a second run does, and what an edit or a fault costs.

Two of its three scenes, and two of its three resolutions: `make smoke` runs all.
"""

import json
import math
import re

import pandas as pd
import pytest
from PIL import Image

from benchmarks import results
from lfcore.evaluation.tables import MEASURED, make_table

pytestmark = [pytest.mark.workflow, pytest.mark.slow]

CHANGED = {"scenes": ["bike", "cabin"], "views": [16, 64]}
SCENES, VIEWS = CHANGED.values()
CHANGES = [f"{key}={json.dumps(value)}" for key, value in CHANGED.items()]
SMOKE = ("--configfile", "config/smoke.yaml", "--config", *CHANGES, "--", "results/tables/")


@pytest.fixture(scope="module")
def smoke(project_copy):
    """A copy of the project after ``snakemake --configfile config/smoke.yaml``."""
    checkout = project_copy("smoke")
    assert checkout.made(*SMOKE)["trace"] == 2 * 2
    return checkout


def table(checkout, name):
    return pd.read_csv(checkout.folder / "results" / "tables" / f"{name}.csv")


def test_each_table_has_a_row_for_each_scene_and_resolution(smoke):
    for name in MEASURED:
        rows = table(smoke, name)
        assert list(rows.columns) == list(make_table(name, []).columns)
        assert rows.scene.tolist() == [scene for scene in SCENES for _ in VIEWS]
        assert rows.N.tolist() == VIEWS * 2
        assert (rows.M == 32).all() and (rows.seconds > 0).all()
        assert rows.thesis_seconds.notna().all()


def test_quality_rises_with_resolution_and_survives_storage(smoke):
    traced, retrieved = table(smoke, "table_7_1"), table(smoke, "table_7_3")
    for _, rows in traced.groupby("scene"):
        assert rows.psnr_db.is_monotonic_increasing and rows.psnr_db.iloc[0] > 30
        assert rows.psnr_db.iloc[-1] == math.inf and rows.ssim.iloc[-1] == 1
        # Against the true picture, no N is perfect.
        assert rows.psnr_true_db.between(15, 60).all()
    assert retrieved.psnr_db.between(30, 80).all()
    stored = table(smoke, "table_7_2")
    assert (stored.raw_bytes_uint8 == 3 * 32**2 * stored.N**2).all()
    sizes = [
        (smoke.folder / f"results/{row.scene}/M32/N{row.N}/lightfield.mkv").stat().st_size
        for row in stored.itertuples()
    ]
    assert stored.video_bytes.tolist() == sizes


def test_tables_are_kept_with_what_made_them(smoke, tmp_path):
    tables = smoke.folder / "results" / "tables"
    results.keep(tables, tmp_path, MEASURED, "make smoke")
    for name in MEASURED:
        run, rows = results.read_result(tmp_path / f"{name}.csv")
        assert run["command"] == "make smoke" and len(rows) == 4
        page = (tmp_path / f"{name}.md").read_text()
        assert page == (tables / f"{name}.md").read_text() + f"\n{results.source(run)}\n"


def test_each_plane_is_a_picture_the_page_has_them_and_no_raw_frames_are_left(smoke):
    text = (smoke.folder / "results" / "tables" / "index.html").read_text()
    # Three figures a scene, and one of curves a table.
    assert text.count("data:image/png;base64,") == 3 * 2 + 3
    for scene in SCENES:
        assert re.search(f"<(figcaption|summary)>{scene}<", text)
    assert "Error against run time" not in text  # a section of other configurations
    for source in ("on_the_fly", "from_video"):
        assert len(list(smoke.folder.glob(f"results/bike/M32/N64/planes/{source}/*.png"))) == 5
    files = (path for path in (smoke.folder / "results").rglob("[!.]*") if path.is_file())
    left = {path.suffix for path in files}
    assert left == {".npz", ".json", ".mkv", ".png", ".csv", ".md", ".html"}
    assert not list(smoke.folder.glob("results/*/M*/N*/tiles/*.npz"))


def test_a_deleted_table_is_made_again_and_nothing_before_it(smoke):
    path = smoke.folder / "results" / "tables" / "table_7_2.csv"
    content = path.read_bytes()
    path.unlink()
    jobs = smoke.made(*SMOKE)
    assert jobs["thesis_tables"] == 1 and not {"parse", "trace", "evaluate"} & set(jobs)
    assert path.read_bytes() == content


@pytest.mark.parametrize(
    ("edited", "again", "kept"),
    [
        ("lfcore/tracing/kernels/entry/trace.cl", {"trace", "join", "page"}, {"parse", "build"}),
        ("lfcore/evaluation/metrics.py", {"evaluate", "page"}, {"parse", "build", "trace"}),
        ("lfcore/refocus/slicing.py", {"retrieve"}, {"parse", "build", "trace", "join"}),
    ],
)
def test_an_edit_runs_again_what_depends_on_it(smoke, edited, again, kept):
    path = smoke.folder / edited
    source = path.read_bytes()
    path.write_bytes(source + b"\n")
    try:
        jobs = smoke.planned(*SMOKE)
    finally:
        path.write_bytes(source)
    assert again <= set(jobs) and not kept & set(jobs)


def test_a_scene_that_cannot_be_read_is_one_clear_message(smoke, tmp_path):
    scene = tmp_path / "broken.yaml"
    scene.write_text("objects: [{file: absent.obj}]")
    target = ("results/broken/scene.npz",)
    done = smoke.snakemake("--cores", "1", "--config", f"scenes=[{scene}]", "--", *target)
    assert done.returncode != 0
    assert "absent.obj' not found" in done.stdout and "Traceback" not in done.stdout
    assert not (smoke.folder / target[0]).exists()
    log = (smoke.folder / "logs" / "parse" / "broken.log").read_text().splitlines()
    assert len(log) == 1 and "broken.yaml: objects[0].file" in log[0]


def test_pictures_of_any_width_and_height_go_all_the_way(project_copy):
    checkout = project_copy("wide")
    reports = "[sub_aperture_views,recipes,quality,retrieval,chosen_rays,work_precision]"
    jobs = checkout.made(
        "--configfile", "config/micro.yaml", "--config", "pixels=24x16", "scenes=[chart]",
        "views=[4]", f"reports={reports}", "--", "results/tables/",
    )  # fmt: skip
    assert jobs["trace"] == 1 and "stability" not in jobs
    results = checkout.folder / "results"
    for name in ("table_7_1", "table_7_2", "table_7_3", "chosen_rays", "retrieval"):
        assert (pd.read_csv(results / "tables" / f"{name}.csv").M == "24x16").all(), name
    stored = pd.read_csv(results / "tables" / "table_7_2.csv")
    assert (stored.raw_bytes_uint8 == 3 * 24 * 16 * stored.N**2).all()
    for source in ("on_the_fly", "from_video"):
        for file in (results / f"chart/M24x16/N4/planes/{source}").glob("*.png"):
            with Image.open(file) as picture:
                assert picture.size == (24, 16)
    assert "24x16" in (results / "tables" / "index.html").read_text()


def test_the_assignment_is_made(project_copy):
    checkout = project_copy("assignment")
    jobs = checkout.made("--configfile", "config/micro.yaml", "--", "results/assignment/")
    folder = checkout.folder / "results" / "assignment"
    assert jobs["assignment_trace"] == len(list((folder / "arrays").glob("*.exr"))) == 2
    shown = {path.stem: Image.open(path) for path in (folder / "figures").glob("*.png")}
    assert {"see_through", "few_cameras", "equal_storage", "time"} <= set(shown)
    for name, picture in shown.items():
        darkest, brightest = picture.convert("L").getextrema()
        assert brightest - darkest > 50, name
