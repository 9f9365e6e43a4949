"""Points, orders, fronts and recommendations, by hand and on a scene of two triangles."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from lfcore.errors import DeviceError, OpticsError, StorageError
from lfcore.evaluation.diagrams import (
    DIRECTIONS,
    DISTANCES_PT,
    PointLabel,
    label_points,
    pareto,
)
from lfcore.evaluation.recommendation import DEFAULT_TASK, recommendation
from lfcore.evaluation.stability.tested_tracer import bare_scene
from lfcore.evaluation.work_precision import convergence as orders
from lfcore.evaluation.work_precision import (
    quadrature,
    recorded,
    refocused,
    samples,
    stored,
    windows,
)
from lfcore.evaluation.work_precision.figure import convergence, storage, work_precision
from lfcore.evaluation.work_precision.measured_point import (
    COLUMNS,
    NOT_JUDGED,
    TIMES_BELOW,
    measured_point,
)
from lfcore.opencl.device import open_device
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.rendering.direct import trace_picture, trace_planes
from lfcore.scene.appearance import POINT, Light, Material
from lfcore.storage.defaults import chosen_encoding
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer
from lfcore.workflow.settings import check_settings

TRIANGLES = [[[-1, -1, 2], [1, -1, 2.5], [0, 1, 2]], [[-2, -2, 4], [2, -2, 4], [0, 2, 4]]]


@pytest.fixture(scope="module")
def plain():
    """A tracer of two triangles that stand one before the other."""
    scene = bare_scene(TRIANGLES, ambient=(0.5, 0.4, 0.3))
    scene = replace(scene, focus_distances_m=(2.0,))
    return Tracer(scene, build_bvh(scene.triangles), open_device(threads=1))


@pytest.mark.parametrize("pattern", samples.RANDOM)
def test_samples_fill_lens_and_pixel_evenly(pattern):
    points = samples.samples(pattern, 32, 1)
    radius = np.linalg.norm(points.lens, axis=1)
    assert points.lens.shape == points.place.shape == (1024, 2) and radius.max() <= 1
    assert np.mean(radius < np.sqrt(0.5)) == pytest.approx(0.5, abs=0.06)
    assert np.abs(points.place).max() <= 0.5 and points.weight.sum() == pytest.approx(1)
    assert np.mean(points.place < 0, axis=0) == pytest.approx(0.5, abs=0.06)
    correlation = np.corrcoef(points.lens.T, points.place.T)[:2, 2:]
    assert np.abs(correlation).max() < 0.12, "a lens sample's place in the pixel is its own"
    assert not np.array_equal(points.lens, samples.samples(pattern, 32, 2).lens)


def test_a_stratum_has_one_sample():
    points = samples.samples("stratified", 8, 3)
    strata = np.floor((points.place + 0.5) * 8).astype(int)
    assert len({tuple(pair) for pair in strata.tolist()}) == 64


def test_a_crossed_grid_weighs_the_open_lens():
    points = samples.samples(samples.CROSSED, 16, 0)
    assert points.weight.sum() == pytest.approx(1) and len(points.weight) < 256
    assert np.linalg.norm(points.lens, axis=1).max() <= 1
    np.testing.assert_allclose(points.weight @ points.lens, 0, atol=1e-12)
    # The mean of r squared over a disk is a half: cells at the rim stand for what is open of them.
    assert points.weight @ np.square(points.lens).sum(1) == pytest.approx(0.5, abs=0.003)


def test_unknown_samples_are_refused():
    with pytest.raises(OpticsError, match="unknown samples"):
        samples.samples("golden", 4, 0)


@pytest.mark.kernels
def test_sampled_pictures_converge_to_the_slab_s(plain):
    """Through the middle of a pixel, samples of the lens alone come to a grid's sums."""
    camera = plain.scene.camera
    plane = SensorPlane(camera.focus_m, camera.f_number)
    whole = trace_picture(plain, camera, 48, plane, views=64)
    corners = np.array([[16, 0], [16, 32]])
    where = windows.Windows(48, corners, np.full((2, 16, 16), 3))
    grid = quadrature.grid(plain, camera, where, 64)
    expected = np.concatenate(
        [whole[row : row + 16, column : column + 16] for column, row in corners]
    )
    np.testing.assert_allclose(grid, expected, atol=1e-6)
    errors = []
    for side in (2, 8, 32):
        points = samples.samples("Halton", side, 0)
        points = replace(points, place=np.zeros_like(points.place))
        made = samples.pictures(plain, camera, 48, points, corners, 16)
        errors.append(np.sqrt(np.square(made - grid).mean()))
    assert errors[0] > 2 * errors[2] and errors[2] < 0.01


@pytest.mark.kernels
def test_every_pattern_comes_to_the_true_windows_but_the_middle_of_the_pixel(plain):
    camera = plain.scene.camera
    where = windows.choose(plain, camera, 64)
    truth, square_error = quadrature.true_windows(plain, camera, where, [[32, 3], [24, 4]])

    def error(pattern: str, side: int) -> float:
        points = samples.samples(pattern, side, 0)
        made = samples.pictures(plain, camera, 64, points, where.corners, windows.SIDE)
        return np.sqrt(np.square(made - truth).mean())

    middle = np.sqrt(np.square(quadrature.grid(plain, camera, where, 64) - truth).mean())
    assert np.sqrt(square_error.mean()) < middle / 20
    for pattern in samples.PATTERNS:
        assert error(pattern, 32) < min(middle / 2, error(pattern, 4) / 2)


@pytest.mark.kernels
def test_alike_lattices_are_no_reference_of_windows(plain):
    where = windows.Windows(16, np.array([[0, 0]]), np.zeros((1, 16, 16)))
    with pytest.raises(OpticsError, match="too alike"):
        quadrature.true_windows(plain, plain.scene.camera, where, [[8, 3], [8, 4]])


def test_a_point():
    reference = np.full((4, 4, 3), 0.5)
    row = measured_point(
        lambda seed: reference + 0.01, reference, 1e-4, seeds=2, method="m", knob="k"
    )
    assert set(row) == set(COLUMNS) and row["rmse"] == pytest.approx(0.01)
    assert row["repeats"] == 9 and row["quartile_1_seconds"] <= row["seconds"]
    masks = {"left": np.arange(16).reshape(4, 4) % 4 < 2, "none": np.zeros((4, 4), bool)}
    row = measured_point(lambda seed: reference + 0.01, reference, 1e-4, masks=masks, pictures=4)
    assert row["rmse_left"] == pytest.approx(0.01) and "rmse_none" not in row


def test_what_a_reference_cannot_judge_says_so_and_keeps_its_seconds():
    """Ten decibels below an error its reference's own must be: a factor of 3.16."""
    reference = np.full((4, 4, 3), 0.5)
    masks = {"left": np.arange(16).reshape(4, 4) % 4 < 2}
    for doubt, judged in ((0.0031, True), (0.0032, False)):
        row = measured_point(
            lambda seed: reference + 0.01, reference, doubt, masks=masks, reference_left=0.001
        )
        assert (row["rmse"] is not None) == (row["psnr_db"] is not None) == judged
        assert row["seconds"] > 0 and row["rmse_left"] == pytest.approx(0.01)
        assert (row["note"] or "").startswith(NOT_JUDGED) != judged
    row = measured_point(
        lambda seed: reference + 0.01, reference, 1e-4, masks=masks, reference_left=0.01
    )
    assert row["rmse"] and row["rmse_left"] is None, "each kind has a reference of its own"
    exact = measured_point(lambda seed: reference, reference, 1e-4)
    assert exact["rmse"] == 0 and exact["note"] is None


@pytest.mark.kernels
def test_windows_are_the_richest_of_each_kind():
    materials = [Material("plain"), Material("shiny", specular=(1.0, 1.0, 1.0), shininess=200.0)]
    light = Light(POINT, (0.5, 0.0, 0.0), (1.0, 1.0, 1.0), casts_shadows=False)
    scene = bare_scene(
        TRIANGLES, materials=materials, lights=[light], material_ids=np.int32([1, 0])
    )
    tracer = Tracer(scene, build_bvh(scene.triangles), open_device(threads=1))
    where = windows.choose(tracer, scene.camera, 64)
    assert len({tuple(corner) for corner in where.corners.tolist()}) == 4
    assert where.masks["edges"].sum() > 4 and where.masks["smooth"].sum() > 256
    assert sum(mask.sum() for mask in where.masks.values()) == 4 * 256


def test_convergence_says_where_the_order_breaks():
    rows = [
        {
            "scene": "s", "f_number": 1.0, "method": "Halton", "rays_per_pixel": n * n,
            "rmse": n**-1.5, "rmse_edges": n**-1.5, "rmse_smooth": n**-2.0 if n < 32 else None,
        }
        for n in (4, 8, 16, 32, 64)
    ]  # fmt: skip
    points = pd.DataFrame(rows)
    found = {row["pixels"]: row for row in orders.convergence(points)}
    assert set(found) == {"all", "edges", "smooth"}
    assert found["edges"]["order"] == pytest.approx(1.5) and found["edges"]["breaks"]
    assert found["smooth"]["order"] == pytest.approx(2) and not found["smooth"]["breaks"]
    assert found["smooth"]["points"] == 3, "what cannot be judged does not count"
    grid = points.assign(method=quadrature.MIDDLE)
    assert orders.convergence(grid)[0]["breaks"] is None, "no order is known of it"


def _study(**more):
    known = {"pixels": 16, "truth": [[24, 6], [20, 7]], "views": [4, 16, 32]}
    return SimpleNamespace(**known | {"monte_carlo_samples": [256]} | more)


@pytest.fixture(scope="module")
def truth(plain):
    return refocused.refocused_picture(plain, 16, _study().truth)


@pytest.mark.kernels
def test_a_recorded_field_is_sliced_alike_by_all_methods(plain, truth):
    """The methods' common light field: shift-sum of it is what slicing makes on the fly."""
    slab = Slab(plain.scene.camera, 8, 16)
    field = recorded.record(plain, slab)
    inside = refocused._inside(slab, truth.planes[0])
    sliced = trace_planes(plain, slab, truth.planes)[0]
    made = {
        name: method(plain, field, truth.planes[0])(0) for name, method in recorded.METHODS.items()
    }
    assert set(made) == {"shift-sum, nearest", "shift-sum, bilinear", "plenoptic camera", "Isaksen"}
    np.testing.assert_allclose(made["shift-sum, nearest"][inside], sliced[inside], atol=1e-5)
    others = [*made.values(), recorded._monte_carlo(plain, field, truth.planes[0], 256)(0)]
    others.append(recorded._stack(plain, field, truth.planes[0], 0.05)(0))
    assert all(np.abs(one[inside] - sliced[inside]).mean() < 0.05 for one in others)


@pytest.mark.kernels
def test_refocusing_is_judged_by_the_true_picture(plain, truth):
    """More views alone end at what recorded pixels lose; few rays by depth are nearer."""
    rows = pd.DataFrame(refocused.tracing(plain, _study(), truth)).set_index(["method", "knob"])
    assert rows.seconds.notna().all()
    nearest, by_depth = rows.psnr_db["nearest pixel"], rows.psnr_db["by depth"]
    assert by_depth["4 x 2"] > nearest.max() + 3
    assert abs(nearest["N = 32"] - nearest["N = 16"]) < 1
    rays = rows.rays_per_pixel
    assert rays["by depth", "4 x 2"] == 4 * rays["nearest pixel", "N = 4"]


@pytest.mark.kernels
def test_a_store_costs_bytes_and_errs_by_its_rays_and_its_codec(plain):
    study = _study(
        stored_pixels=16, stored_lattice=[4, 2], video_views=8, crfs=[12, 40],
        codecs=[{"name": "default"}, {"name": "AV1", "codec": "libsvtav1", "preset": "12",
        "pixel_format": "yuv420p", "crf_offset": 10}],
    )  # fmt: skip
    rows = pd.DataFrame(stored.storage(plain, study)).set_index(["method", "knob"])
    assert list(rows.index) == [
        ("default", "CRF 12"), ("default", "CRF 40"), ("AV1", "CRF 22"), ("AV1", "CRF 50"),
        ("default, N = 8", "CRF 12"), ("default, N = 8", "CRF 40"),
    ]  # fmt: skip
    assert (rows.read_seconds > 0).all() and (rows.seconds > 0).all()
    for name in ("default", "default, N = 8"):
        fine, coarse = rows.loc[name].iloc[0], rows.loc[name].iloc[1]
        assert fine.bytes > coarse.bytes and fine.psnr_codec_db > coarse.psnr_codec_db + 3
    best = rows.xs("CRF 12", level="knob")
    assert best.psnr_db["default"] > best.psnr_db["default, N = 8"] + 3
    assert best.psnr_codec_db["default, N = 8"] > best.psnr_db["default, N = 8"] + 3


def test_a_method_that_refuses_is_shown_as_failed():
    def refuse(seed):
        raise OpticsError("no")

    row = measured_point(refuse, np.zeros((2, 2, 3)), None, method="m")
    assert row["rmse"] is None and row["method"] == "m" and row["note"] == "refused: no"
    for error in (ZeroDivisionError(), DeviceError("lost"), StorageError("full")):

        def fail(seed, error=error):
            raise error

        with pytest.raises(type(error)):
            measured_point(fail, np.zeros((2, 2, 3)), None)


def test_orders():
    rows = [{"rays_per_pixel": n * n, "rmse": 3.0 * n**-1.5} for n in (4, 8, 16)]
    found = [row.get("order") for row in orders.with_orders(rows)]
    assert found == [None, pytest.approx(1.5), pytest.approx(1.5)]
    errors = np.array([row["rmse"] for row in rows])
    assert orders.fitted_order(np.array([4, 8, 16]), errors) == pytest.approx(1.5)


def test_pareto_front():
    error, seconds = np.array([3, 2, 2.5, 1, np.nan]), np.array([1, 2, 3, 4, 0.5])
    assert pareto(error, seconds).tolist() == [True, True, False, True, False]


POINTS = pd.DataFrame(
    [
        {"panel": "tracing", "method": "a", "knob": "N = 4", "psnr_db": 36, "seconds": 2.0,
         "rmse": 0.1},
        {"panel": "tracing", "method": "b", "knob": "N = 8", "psnr_db": 41, "seconds": 1.0,
         "rmse": 0.05},
        {"panel": "tracing", "method": "b", "knob": "N = 9", "psnr_db": 46, "seconds": 5.0,
         "rmse": 0.01},
        {"panel": "tracing", "method": "c", "knob": "CRF 9", "note": "refused: no"},
        {"panel": "tracing", "method": "b", "knob": "N = 99", "seconds": 9.0,
         "reference_rmse": 0.002, "note": "not judged: error 0.001"},
    ],
    columns=list(COLUMNS),
).assign(scene="s", f_number=1.0, bytes=[None, None, 300.0, None, None])  # fmt: skip


def test_recommendation():
    table = recommendation(POINTS, [35, 40, 45, 50]).set_index("target_db")
    assert table.method.tolist()[:3] == ["b", "b", "b"]
    assert table.setting.tolist() == ["N = 8", "N = 8", "N = 9", "none measured reaches it"]
    assert table.psnr_db[50] == 46 and np.isnan(table.seconds[50])


def test_the_default_encoder_is_judged_by_what_it_loses():
    """A grid's own error is no encoder's: the CRF is recommended by the codec's loss."""
    rows = POINTS[:2].assign(
        panel="storage", method=["default", "default, N = 8"], psnr_db=[41, 33],
        psnr_codec_db=[None, 46], bytes=[100, 900],
    )  # fmt: skip
    table = recommendation(rows, [45]).set_index("task")
    assert table.setting["store a light field"] == "none measured reaches it"
    assert table.setting[DEFAULT_TASK] == "N = 8" and table.psnr_db[DEFAULT_TASK] == 46


def test_figures_show_every_point_and_what_failed(tmp_path, drawn, shows):
    work_precision(tmp_path / "a.png", POINTS, machine="a machine")
    stored_points = POINTS.assign(
        bytes=[300, 200, 100, None, None], read_seconds=[0.1, 0.3, 0.2, None, None]
    )
    storage(tmp_path / "b.png", stored_points, machine="a machine")
    curve = POINTS.assign(
        rays_per_pixel=[4, 16, 64, 256, 1024], rmse_edges=[0.2, 0.1, 0.05, None, None]
    )
    convergence(tmp_path / "c.png", curve)
    first, second, third = (figure.axes for figure in drawn)
    good = POINTS[POINTS.rmse.notna()]
    assert shows(first[0], good[["rmse", "seconds"]].to_numpy())
    assert shows(first[0], [[TIMES_BELOW * 0.002, 9.0]]), "what cannot be judged is shown"
    written = [text.get_text() for text in first[0].texts]
    assert "c 9: refused" in written and {"4", "8", "9", "99"} < set(written)
    stored_good = stored_points[stored_points.rmse.notna()]
    for axis, cost in zip(second, ("bytes", "seconds", "read_seconds"), strict=True):
        assert shows(axis, stored_good[[cost, "rmse"]].to_numpy())
    sides = np.sqrt(curve.rays_per_pixel)[:3]
    assert shows(third[0], np.stack([sides, curve.rmse[:3]], 1))
    assert all(axis.get_title().startswith("s") for axis in (*first, *second, *third))


def test_labels_cover_neither_one_another_nor_points():
    figure = Figure(figsize=(4, 3))
    axis = figure.subplots()
    rng = np.random.default_rng(2)
    x, y = 1 + rng.random((2, 40)) * [[1], [0.3]]
    axis.plot(x, y, "o", markersize=4)
    axis.set(xlim=(0.5, 2.5), ylim=(0, 2), xscale="log")
    labels = [PointLabel(axis, *at, f"{n} x 1.25", "C0") for n, at in enumerate(zip(x, y))]  # noqa: B905
    written = label_points(figure, labels)
    boxes = [note.get_window_extent() for note in written]
    assert len(written) > 25
    assert not any(a.overlaps(b) for n, a in enumerate(boxes) for b in boxes[:n])
    points = axis.transData.transform(np.stack([x, y], 1))
    assert not any(box.contains(*point) for box in boxes for point in points)
    room = axis.get_window_extent()
    assert all(room.x0 <= box.x0 and box.x1 <= room.x1 for box in boxes)
    places = len(DIRECTIONS) * len(DISTANCES_PT)
    many = label_points(figure, labels[:1] * (places + 1))
    assert len(many) <= places, "what has no room is left out"


def test_the_default_encoder_s_setting_is_the_recommended_one():
    """The CRF that the measured table recommends for 45 dB in the most demanding scene."""
    root = Path(__file__).parents[2]
    table = pd.read_csv(root / "docs" / "results" / "recommended.csv", comment="#")
    study = check_settings({})["analysis"]
    rows = table[(table.task == DEFAULT_TASK) & (table.target_db == 45)]
    assert set(rows.scene) == {"bike", "cabin", "bedroom"} and (rows.psnr_db >= 45).all()
    needed = min(float(setting.removeprefix("CRF ")) for setting in rows.setting)
    assert chosen_encoding(study["work_precision"]["video_views"]).crf == needed
