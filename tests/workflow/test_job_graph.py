"""Dry runs: which jobs a configuration asks for, and what is refused before the first."""

import pytest

pytestmark = pytest.mark.workflow

SMOKE = ("--configfile", "config/smoke.yaml")
TARGET = ("--", "results/tables/")
STORE_REPORTS = {
    "storage_layouts", "rate_distortion", "equivalence", "retrieval", "plenoptic_photograph",
    "other_renderers",
}  # fmt: skip


@pytest.fixture(scope="module")
def default_jobs(checkout):
    """What the default run asks for."""
    return checkout.planned("--", "results/tables")


def test_smoke(checkout):
    jobs = checkout.planned(*SMOKE, *TARGET)
    assert jobs["parse"] == jobs["build"] == jobs["evaluate"] == 3
    # Small ones are a job each, two tiles or not.
    assert jobs["trace"] == jobs["join"] == jobs["retrieve"] == 3 * 3
    assert jobs["contact_sheets"] == 3
    assert jobs["page"] == jobs["thesis_tables"] == jobs["curves"] == 1
    assert STORE_REPORTS.isdisjoint(jobs)


def test_the_default_run_has_a_row_for_each_scene_and_resolution(default_jobs):
    jobs = default_jobs
    assert jobs["join"] == 18 and jobs["chosen_rays_scene"] == jobs["work_precision_scene"] == 3
    # Large light fields are several jobs, so that two cores share them.
    assert jobs["trace"] > jobs["join"]
    assert set(jobs) >= STORE_REPORTS and jobs["retrieval_scene"] == jobs["equivalence_scene"] == 3


def test_tables_of_camera_arrays_are_quick_ones(checkout, default_jobs):
    """Of the assignment's scenes the large one is not traced for results/tables/."""
    jobs = default_jobs
    assert jobs["array_tables"] == jobs["assignment_reconstruction"] == 1
    assert jobs["assignment_trace"] == 2 and "assignment_see_through" not in jobs
    whole = checkout.planned("--", "results/assignment/")
    assert whole["assignment_trace"] == 3 and whole["assignment_tables"] == 1


def test_what_is_not_asked_for_is_not_in_the_graph(checkout):
    jobs = checkout.planned(
        *SMOKE, "--config", "store=false", "scenes=[bike]",
        "reports=[quality, retrieval, equivalence]", *TARGET,
    )  # fmt: skip
    # What is not stored cannot be read.
    assert "retrieval" not in jobs and jobs["equivalence"] == jobs["equivalence_scene"] == 1
    assert {"retrieve", "viewer", "contact_sheets", "trace_stacks"}.isdisjoint(jobs)
    assert jobs["curves"] == 1 and jobs["parse"] == 1
    only_views = checkout.planned(*SMOKE, "--config", "reports=[sub_aperture_views]", *TARGET)
    assert only_views["trace_stacks"] == only_views["contact_sheets"] == 3
    assert "curves" not in only_views


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
        ("pixles=64", "'pixles' was unexpected"),
        ("layout={pack: 0}", "layout.pack: 0"),
        ("scenes=[nowhere]", "there is no scene 'nowhere'"),
        ("encoding={codec: libsvtav1, pixel_format: yuv444p}", "libsvtav1 does not take yuv444p"),
    ],
)
def test_impossible_configurations_stop_before_the_first_job(checkout, override, words):
    done = checkout.snakemake("--cores", "2", "--config", override, *TARGET)
    assert done.returncode != 0
    assert words in done.stdout
    assert not (checkout.folder / "results").exists()
