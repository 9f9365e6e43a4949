"""Points, orders, fronts and recommendations, by hand and on a scene of two triangles."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import yaml

from lfcore.errors import DeviceError, OpticsError, StorageError
from lfcore.evaluation.recommendation import DEFAULT_TASK, recommendation
from lfcore.evaluation.stability.tested_tracer import bare_scene
from lfcore.evaluation.tables import TableError
from lfcore.evaluation.work_precision import lens_samples, methods, quadrature, stored, windows
from lfcore.evaluation.work_precision.figure import convergence, pareto, storage, work_precision
from lfcore.evaluation.work_precision.point import (
    COLUMNS,
    check_trusted,
    fitted_order,
    point,
    trusted,
    with_orders,
)
from lfcore.opencl.device import open_device
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.rendering.direct import trace_picture
from lfcore.scene.appearance import POINT, Light, Material
from lfcore.storage.defaults import default_spec
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer

TRIANGLES = [[[-1, -1, 2], [1, -1, 2.5], [0, 1, 2]], [[-2, -2, 4], [2, -2, 4], [0, 2, 4]]]


@pytest.mark.parametrize("pattern", lens_samples.PATTERNS)
def test_lens_points_fill_the_disk_evenly(pattern):
    points = lens_samples.lens_points(pattern, 32, 1)
    radius = np.linalg.norm(points, axis=1)
    assert points.shape == (1024, 2) and radius.max() <= 1
    assert np.mean(radius < np.sqrt(0.5)) == pytest.approx(0.5, abs=0.06)
    assert not np.array_equal(points, lens_samples.lens_points(pattern, 32, 2))


def test_unknown_lens_points_are_refused():
    with pytest.raises(OpticsError, match="unknown lens samples"):
        lens_samples.lens_points("golden", 4, 0)


@pytest.mark.kernels
def test_sampled_pictures_converge_to_the_slab_s():
    scene = bare_scene(TRIANGLES, ambient=(0.5, 0.4, 0.3))
    tracer = Tracer(scene, build_bvh(scene.triangles), open_device(threads=1))
    camera = scene.camera
    plane = SensorPlane(camera.focus_distance_m, camera.f_number)
    whole = trace_picture(tracer, camera, 48, plane, views=64)
    corners = np.array([[16, 0], [16, 32]])
    where = windows.Windows(48, corners, np.full((2, 16, 16), 3))
    grid = quadrature.grid(tracer, camera, where, 64)
    expected = np.concatenate(
        [whole[row : row + 16, column : column + 16] for column, row in corners]
    )
    np.testing.assert_allclose(grid, expected, atol=1e-6)
    errors = []
    for side in (2, 8, 32):
        points = lens_samples.lens_points("Halton", side, 0)
        made = lens_samples.pictures(tracer, camera, 48, points, corners, 16)
        errors.append(np.sqrt(np.square(made - grid).mean()))
    assert errors[0] > 2 * errors[2] and errors[2] < 0.01


def test_a_point():
    reference = np.full((4, 4, 3), 0.5)
    row = point(lambda seed: reference + 0.01, reference, 1e-4, seeds=2, method="m", knob="k")
    assert set(row) == set(COLUMNS) and row["rmse"] == pytest.approx(0.01)
    assert row["repeats"] == 20 and row["quartile_1_seconds"] <= row["seconds"]
    parts = {"left": np.arange(16).reshape(4, 4) % 4 < 2, "none": np.zeros((4, 4), bool)}
    row = point(lambda seed: reference + 0.01, reference, 1e-4, parts=parts, pictures=4)
    assert row["rmse_left"] == pytest.approx(0.01) and "rmse_none" not in row


def test_points_as_good_as_their_reference_are_not_shown():
    reference = np.full((4, 4, 3), 0.5)
    good = point(lambda seed: reference + 0.01, reference, 1e-4)
    close = point(lambda seed: reference + 9e-4, reference, 1e-4)
    failed = point(lambda seed: reference * np.nan, reference, 1e-4)
    assert trusted([good, close, failed]) == [good, failed]
    check_trusted([good, failed])
    with pytest.raises(TableError, match="reference_views"):
        check_trusted([good, close])


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
    assert where.parts["edges"].sum() > 4 and where.parts["smooth"].sum() > 256
    assert sum(mask.sum() for mask in where.parts.values()) == 4 * 256


def test_convergence_says_where_the_order_breaks():
    rows = [
        {
            "scene": "s", "f_number": 1.0, "method": "stratified", "rays_per_pixel": n * n,
            "rmse": n**-1.5, "reference_rmse": 0.0, "rmse_edges": n**-1.5, "rmse_smooth": n**-2.0,
            "reference_smooth": 1e-4,
        }
        for n in (4, 8, 16, 32, 64)
    ]  # fmt: skip
    found = {row["pixels"]: row for row in quadrature.convergence(rows)}
    assert set(found) == {"all", "edges", "smooth"}
    assert found["edges"]["order"] == pytest.approx(1.5) and found["edges"]["breaks"]
    assert found["smooth"]["order"] == pytest.approx(2) and not found["smooth"]["breaks"]
    assert found["smooth"]["points"] == 3, "points near their reference do not count"


@pytest.mark.kernels
def test_a_recorded_field_is_sliced_alike_by_all_methods():
    """The methods' common light field: shift-sum of it is what slicing makes on the fly."""
    scene = bare_scene(TRIANGLES, ambient=(0.5, 0.4, 0.3))
    tracer = Tracer(scene, build_bvh(scene.triangles), open_device(threads=1))
    slab, plane = Slab(scene.camera, 8, 16), SensorPlane(3.0, scene.camera.f_number)
    recorded = methods.record(tracer, slab)
    inside = methods._inside(slab, plane)
    sliced = methods._sliced(tracer, slab, plane)
    made = {name: work(0) for name, work in methods._jobs(tracer, recorded, plane)}
    assert set(made) == {"shift-sum, nearest", "shift-sum, bilinear", "plenoptic camera", "Isaksen"}
    np.testing.assert_allclose(made["shift-sum, nearest"][inside], sliced[inside], atol=1e-5)
    others = [*made.values(), methods._monte_carlo(tracer, recorded, plane, 256)(0)]
    others.append(methods._stack(tracer, recorded, plane, 0.05)(0))
    assert all(np.abs(one[inside] - sliced[inside]).mean() < 0.05 for one in others)


@pytest.mark.kernels
def test_a_store_costs_bits_and_has_the_codec_s_error_alone():
    scene = bare_scene(TRIANGLES, ambient=(0.5, 0.4, 0.3))
    tracer = Tracer(scene, build_bvh(scene.triangles), open_device(threads=1))
    scene = replace(scene, focus_distances_m=(2.0,))
    tracer.scene = scene
    study = SimpleNamespace(
        video_views=8, pixels=16, crfs=[12, 30], codecs=[{"name": "default"}, {"name": "AV1",
        "codec": "libsvtav1", "preset": "12", "pixel_format": "yuv420p", "crf_offset": 10}],
    )  # fmt: skip
    rows = list(stored.storage(tracer, study))
    assert [row["knob"] for row in rows] == ["CRF 12", "CRF 30", "CRF 22", "CRF 40"]
    assert all(row["bits_per_ray"] > 0 and row["rmse"] < 0.1 for row in rows)
    assert rows[0]["bits_per_ray"] > rows[1]["bits_per_ray"] and rows[0]["rmse"] < rows[1]["rmse"]


def test_a_method_that_refuses_is_shown_as_failed():
    def refuse(seed):
        raise OpticsError("no")

    row = point(refuse, np.zeros((2, 2, 3)), None, method="m")
    assert row["rmse"] is None and row["method"] == "m"
    for error in (ZeroDivisionError(), DeviceError("lost"), StorageError("full")):

        def fail(seed, error=error):
            raise error

        with pytest.raises(type(error)):
            point(fail, np.zeros((2, 2, 3)), None)


def test_orders():
    rows = [{"rays_per_pixel": n * n, "rmse": 3.0 * n**-1.5} for n in (4, 8, 16)]
    orders = [row.get("order") for row in with_orders(rows)]
    assert orders == [None, pytest.approx(1.5), pytest.approx(1.5)]
    assert fitted_order([4, 8, 16], [row["rmse"] for row in rows]) == pytest.approx(1.5)


def test_pareto_front():
    error, seconds = np.array([3, 2, 2.5, 1, np.nan]), np.array([1, 2, 3, 4, 0.5])
    assert pareto(error, seconds).tolist() == [True, True, False, True, False]


POINTS = pd.DataFrame(
    [
        {"panel": "methods", "method": "a", "knob": "N = 4", "psnr_db": 36, "seconds": 2.0,
         "rmse": 0.1},
        {"panel": "methods", "method": "b", "knob": "N = 8", "psnr_db": 41, "seconds": 1.0,
         "rmse": 0.05},
        {"panel": "methods", "method": "b", "knob": "N = 9", "psnr_db": 46, "seconds": 5.0,
         "rmse": 0.01},
        {"panel": "methods", "method": "c", "knob": "CRF 9"},
    ],
    columns=list(COLUMNS),
).assign(scene="s", f_number=1.0, bits_per_ray=[None, None, 0.3, None])  # fmt: skip


def test_recommendation():
    table = recommendation(POINTS, [35, 40, 45, 50]).set_index("target_db")
    assert table.method.tolist()[:3] == ["b", "b", "b"]
    assert table.setting.tolist() == ["N = 8", "N = 8", "N = 9", "none measured reaches it"]
    assert table.psnr_db[50] == 46 and np.isnan(table.seconds[50])


def test_figures_show_every_point_and_what_failed(tmp_path, drawn, shows):
    work_precision(tmp_path / "a.png", POINTS, machine="a machine")
    stored_points = POINTS.assign(bits_per_ray=[0.3, 0.2, 0.1, None])
    storage(tmp_path / "b.png", stored_points, machine="a machine")
    curve = POINTS.assign(rays_per_pixel=[4, 16, 64, 256], rmse_edges=[0.2, 0.1, 0.05, None])
    convergence(tmp_path / "c.png", curve)
    first, second, third = (figure.axes for figure in drawn)
    good = POINTS[POINTS.rmse.notna()]
    assert shows(first[0], good[["rmse", "seconds"]].to_numpy())
    assert "c 9: refused" in " ".join(text.get_text() for text in first[0].texts).replace(
        "CRF ", ""
    )
    bits = stored_points[stored_points.rmse.notna()]
    assert shows(second[0], bits[["bits_per_ray", "rmse"]].to_numpy())
    assert shows(second[1], bits[["seconds", "rmse"]].to_numpy())
    sides = np.sqrt(curve.rays_per_pixel)[:3]
    assert shows(third[0], np.stack([sides, curve.rmse[:3]], 1))
    assert all(axis.get_title().startswith("s") for axis in (*first, *second, *third))


def test_the_default_encoder_s_setting_is_the_recommended_one():
    """The CRF that the measured table recommends for 45 dB in the most demanding scene."""
    root = Path(__file__).parents[2] / "config"
    table = pd.read_csv(root / "recommended.csv", comment="#")
    study = yaml.safe_load((root / "config.yaml").read_text(encoding="utf-8"))["analysis"]
    rows = table[(table.task == DEFAULT_TASK) & (table.target_db == 45)]
    assert set(rows.scene) == {"bike", "cabin", "bedroom"} and (rows.psnr_db >= 45).all()
    needed = min(float(setting.removeprefix("CRF ")) for setting in rows.setting)
    assert default_spec(study["work_precision"]["video_views"]).crf == needed
