"""Error against run time: points, methods and diagrams; and which rays to choose."""

import time

import numpy as np
import pandas as pd
import pytest

from lfcore import DeviceError, Lattice, LightField, OpticsError, SensorPlane, Slab, StorageError
from lfcore.errors import SettingsError
from lfcore.evaluation import chosen_rays
from lfcore.evaluation.chosen_rays import chosen_rays_table, chosen_row, thesis_row
from lfcore.evaluation.renderers.rendered import Rendered
from lfcore.evaluation.stability.tested_tracer import bare_scene
from lfcore.evaluation.true_picture import Reference, inner_psnr, true_pictures
from lfcore.evaluation.work_precision import figure, in_memory, points, study
from lfcore.evaluation.work_precision.figure import pareto
from lfcore.evaluation.work_precision.points import COLUMNS, NOT_JUDGED, point, timed_point
from lfcore.evaluation.work_precision.study import peer_rows
from lfcore.optics.ray_cells import displaced_views
from lfcore.refocus.focal_stack import focal_stack_views
from lfcore.refocus.resampling import coverage
from lfcore.rendering.direct import focused_camera, trace_planes

pytestmark = pytest.mark.kernels

SCENE = bare_scene(np.zeros((0, 3, 3)))


class Cpu:
    clock = time.process_time


@pytest.fixture
def grey():
    """True pictures of two grey planes, known to 60 and 50 dB."""
    planes = [SensorPlane(focus, 2.0) for focus in (1.0, 3.0)]
    pictures = np.full((2, 32, 32, 3), 0.5, np.float32)
    return Reference(planes, pictures, np.array([60.0, 50.0]))


def test_a_point_is_of_the_worst_plane_and_judged_beside_the_truths_own_error(grey):
    made = grey.pictures + np.float32([0.001, 0.02])[:, None, None, None]
    row = point(grey, made, rays=2048, scene="s")
    assert set(row) == set(COLUMNS) and row["rays_per_pixel"] == 2
    assert (row["worst_plane_m"], row["truth_known_db"], row["note"]) == (3.0, 50.0, None)
    assert row["psnr_true_db"] < 40 < row["mean_psnr_true_db"]
    for off, note in ((0.02, None), (0.002, NOT_JUDGED)):
        row = point(grey, grey.pictures + np.float32(off), rays=1)
        assert row["note"] == note and row["psnr_true_db"] > 30


def test_a_refused_method_is_a_row_and_other_errors_pass(grey):
    def refuse():
        raise OpticsError("no")

    row = timed_point(grey, refuse, Cpu, rays=1, method="m")
    assert row["seconds"] is None and (row["method"], row["note"]) == ("m", "refused: no")
    for error in (ZeroDivisionError(), DeviceError("lost"), StorageError("full")):

        def fail(error=error):
            raise error

        with pytest.raises(type(error)):
            timed_point(grey, fail, Cpu, rays=1)


def test_few_rays_by_depth_beat_many_that_miss_the_pixel(chart, reference):
    nearest = pd.DataFrame(study.nearest_rows(chart, reference, [8, 16]))
    rows = study.by_depth_rows(chart, reference, [Lattice(4, 1), Lattice(4, 2)])
    together = pd.DataFrame(rows).set_index("setting")
    assert together.psnr_true_db["4 x 2"] > together.psnr_true_db["4 x 1"]
    assert together.psnr_true_db["4 x 2"] > nearest.psnr_true_db.max() + 3
    assert together.rays["4 x 2"] * 4 == nearest.rays[1] and together.seconds.notna().all()


def test_a_wanted_quality_is_reached(chart, reference):
    *rows, beyond = study.quality_rows(chart, reference, [30, 34, 80])
    assert beyond["seconds"] is None and beyond["note"].startswith("refused: 80 dB needs")
    for row, wanted in zip(rows, (30, 34), strict=True):
        assert row["expected_db"] > wanted - 1e-3 and row["psnr_true_db"] > wanted - 2
    assert rows[1]["rays"] > rows[0]["rays"]


def test_a_file_costs_bytes_and_errs_by_its_rays_and_its_codec(chart, reference):
    scene, device, count = chart.scene, chart.device, Lattice(4, 2)
    few = study.recorded_row(scene, reference, Lattice(4, 1), device)
    row = study.recorded_row(scene, reference, count, device)
    assert row["bytes"] > few["bytes"] and row["psnr_true_db"] > few["psnr_true_db"]
    assert row["seconds"] > 0 and row["record_seconds"] > 0
    codecs = [
        {"name": "default"},
        {"name": "AV1", "codec": "libsvtav1", "preset": "12", "pixel_format": "yuv420p",
         "crf_offset": 10},
    ]  # fmt: skip
    rows = pd.DataFrame(study.codec_rows(scene, reference, count, codecs, [12, 40], device))
    assert rows.setting.tolist() == ["CRF 12", "CRF 40", "CRF 22", "CRF 50"]
    fine, coarse = rows.iloc[0], rows.iloc[1]
    assert fine.bytes > coarse.bytes and fine.psnr_true_db > coarse.psnr_true_db + 3


def test_a_grid_of_the_workflow_has_the_seconds_of_its_jobs(grey):
    jobs = (
        {"rays": 64, "seconds": 3.0},
        {"encode_seconds": 2.0, "join_seconds": 1.0, "video_bytes": 99},
        {"seconds": 7.0, "threads": 2},
    )
    row = study.grid_row(grey, 16, grey.pictures + np.float32(0.1), jobs)
    assert (row["record_seconds"], row["seconds"], row["bytes"]) == (6.0, 14.0, 99)


def test_all_methods_in_memory_make_the_same_picture(chart, reference):
    """Shift-sum by the nearest pixel is what slicing makes; the others resample otherwise."""
    slab = Slab(chart.scene.camera, 8, 24)
    views, planes = in_memory.Views(chart, slab), reference.planes[:1]
    inside = coverage(slab, planes[0], "bilinear") > planes[0].mask(slab).sum() * (1 - 1e-6)
    sliced = trace_planes(chart, slab, planes)[0][inside]
    made = {name: method(views, planes)[0] for name, method in in_memory.METHODS.items()}
    np.testing.assert_allclose(made["shift-sum, nearest"][inside], sliced, atol=1e-5)
    made["stack"] = in_memory._by_views(focal_stack_views, views, planes, tolerance_px=0.05)[0]
    made["Monte Carlo"] = in_memory._monte_carlo(256)(views, planes)[0]
    assert {
        name for name, one in made.items() if np.abs(one[inside] - sliced).mean() > 0.05
    } == set()


def _noisy(scene, plane, pixels, views):
    """A renderer whose independent samples err by 0.05 of white each."""
    noise = np.random.default_rng(views).normal(0, 0.05 / views, (pixels, pixels, 3))
    return Rendered("P", np.float32(0.5 + noise), views**2, 1e-6 * (views * pixels) ** 2)


def test_a_peer_needs_what_independent_samples_need(grey):
    """Squared error falls with the samples: 10 dB more need ten times as many."""
    rows = list(peer_rows(SCENE, grey.planes, 64, [50, 60], peers={"P": _noisy}))
    for row, target in zip(rows, (50, 60), strict=True):
        samples = (0.05 * 0.659) ** 2 * 10 ** (target / 10)  # the slope of sRGB at a half
        assert row["rays"] == pytest.approx(2 * samples * 64**2, rel=0.1)
        assert row["seconds"] == pytest.approx(row["rays"] * 1e-6)
        assert (row["expected_db"], row["psnr_true_db"]) == (target, None)
    missing = lambda *_: Rendered("P", None, note="left out: P is not installed")  # noqa: E731
    (row,) = peer_rows(SCENE, grey.planes, 64, [40, 45], peers={"P": missing})
    assert row["note"] == "left out: P is not installed" and row["seconds"] is None


def test_pareto_front():
    error, seconds = np.array([3, 2, 2.5, 1, np.nan]), np.array([1, 2, 3, 4, 0.5])
    assert pareto(error, seconds).tolist() == [True, True, False, True, False]


def _rows(panel, *some):
    known = {"scene": "s", "panel": panel, "f_number": 2.0, "truth_known_db": 60.0, "rays": 1}
    names = ("method", "setting", "seconds", "psnr_true_db", "note")
    return [
        dict.fromkeys(COLUMNS) | known | dict(zip(names, one, strict=True))
        | {"quartile_1_seconds": one[2], "quartile_3_seconds": one[2]}
        for one in some
    ]  # fmt: skip


def test_diagrams_show_every_point_and_what_was_refused(tmp_path, drawn, shows):
    fly = _rows(
        points.ON_THE_FLY, ("a", "4 x 1", 2.0, 36.0, None), ("a", "4 x 2", 4.0, 46.0, None),
        ("b", "N = 8", 1.0, 54.0, NOT_JUDGED), ("c", "N = 9", None, None, "refused: no"),
    )  # fmt: skip
    fly += [fly[0] | {"method": "P", "seconds": 3.0, "psnr_true_db": None, "expected_db": 40.0}]
    read = _rows(points.FROM_FILE, ("d", "CRF 9", 5.0, 41.0, None))
    read[0]["record_seconds"] = 7.0
    memory = _rows(points.IN_MEMORY, ("e", "N = 8", 0.5, 31.0, None))
    rows = pd.DataFrame(fly + read + memory)
    figure.on_the_fly(tmp_path / "a.png", rows, machine="a machine")
    figure.stored(tmp_path / "b.png", rows, machine="a machine")
    (first,), (record, file, inside) = (one.axes for one in drawn)
    assert shows(first, [[2.0, 36.0], [4.0, 46.0], [1.0, 54.0], [3.0, 40.0]])
    assert {"c: refused: no", "8"} <= {text.get_text() for text in first.texts}
    assert shows(record, [[7.0, 41.0]]) and shows(file, [[5.0, 41.0]])
    assert shows(inside, [[0.5, 31.0]])
    assert list(points.table(rows).columns) == list(COLUMNS)


def test_two_lattices_agree_on_the_truth_unless_alike(reference, chart):
    side = reference.size.width
    assert reference.pictures.shape == (2, side, side, 3)
    assert (reference.known_db > 45).all()
    with pytest.raises(OpticsError, match="too similar"):
        true_pictures(chart, reference.planes, 24, (Lattice(8, 3), Lattice(8, 4)))


def test_the_truth_does_not_depend_on_how_it_is_traced(chart, reference):
    """Rays that each count in their own pixel, none spread, give the same picture."""
    plane, side = reference.planes[0], reference.size.width
    slab = Slab(focused_camera(chart.scene.camera, plane), 24, 3 * side)
    inside = plane.mask(slab).ravel()
    light = chart.bundle_radiance(displaced_views(slab).bundles())[inside].clip(0, 1).mean(0)
    plain = light.reshape(side, 3, side, 3, 3).mean((1, 3))
    assert inner_psnr(plain, reference.pictures[0]) > 40


def test_a_quality_is_recorded_and_compared_with_the_recipe(tmp_path, chart, reference):
    file, side = tmp_path / "30.mkv", reference.size.width
    ours = chosen_row(file, chart.scene, chart.device, reference, 30.0)
    assert ours["bytes"] == file.stat().st_size and ours["expected_db"] > 29.5
    assert ours["seconds"] > 0 and ours["read_seconds"] > 0
    with LightField.open(file) as field:
        slab = field.metadata.slab
        pictures = field.refocus_many(reference.planes, device=chart.device)
    assert ours["rays"] == slab.rays == pytest.approx(ours["rays_per_pixel"] * side**2)
    assert ours["psnr_true_db"] == min(reference.psnr(pictures))
    assert ours["psnr_traced_db"] > 28 and ours["psnr_true_db"] > 25
    more = chosen_row(tmp_path / "42.mkv", chart.scene, chart.device, reference, 42.0)
    assert more["rays"] > 2 * ours["rays"]

    jobs = (
        {"seconds": 3.0, "rays": (64 * side) ** 2},
        {"encode_seconds": 2.0, "join_seconds": 1.0, "video_bytes": 4 * ours["bytes"]},
        {"seconds": 7.0, "threads": 2},
    )
    dark = np.zeros_like(reference.pictures)
    theirs = thesis_row("chart", reference, 64, jobs, dark, dark)
    assert theirs["lattice"] == "64 x 1" and theirs["rays"] == (64 * side) ** 2
    assert (theirs["seconds"], theirs["read_seconds"]) == (6.0, 14.0)
    table = chosen_rays_table([theirs, ours, more])
    assert list(table.columns) == list(chosen_rays.COLUMNS)
    assert table.size_share.tolist()[:2] == [1.0, 0.25] and table.rays_share[0] == 1
    assert table.seconds_share[1] == pytest.approx(ours["seconds"] / 6, rel=0.01)


def test_a_quality_beyond_the_budget_names_its_key(tmp_path, chart, reference):
    with pytest.raises(SettingsError, match=r"qualities_db: chart: 75 dB needs over .* Ask for"):
        chosen_row(tmp_path / "75.mkv", chart.scene, chart.device, reference, 75.0)
    assert not list(tmp_path.iterdir())


def test_shares_are_of_each_scenes_first_row():
    row = dict.fromkeys(chosen_rays.COLUMNS) | {"rays": 10, "seconds": 2.0, "bytes": 100}
    rows = [row | {"scene": name, "rays": rays} for name in "ab" for rays in (10, 5)]
    assert chosen_rays.chosen_rays_table(rows).rays_share.tolist() == [1, 0.5, 1, 0.5]
