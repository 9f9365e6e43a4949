"""Points, orders, fronts and recommendations, by hand and on a scene of two triangles."""

import numpy as np
import pandas as pd
import pytest

from lfcore.errors import OpticsError
from lfcore.evaluation.recommendation import recommendation
from lfcore.evaluation.stability.subject import bare_scene
from lfcore.evaluation.work_precision import lens_samples
from lfcore.evaluation.work_precision.figure import pareto, storage, work_precision
from lfcore.evaluation.work_precision.point import COLUMNS, fitted_order, point, with_orders
from lfcore.opencl.device import open_device
from lfcore.optics.planes import SensorPlane
from lfcore.refocus.direct import trace_picture
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


def test_sampled_pictures_converge_to_the_slab_s():
    scene = bare_scene(TRIANGLES, ambient=(0.5, 0.4, 0.3))
    tracer = Tracer(scene, build_bvh(scene.triangles), open_device(threads=1))
    camera = scene.camera
    plane = SensorPlane(camera.focus_distance_m, camera.f_number)
    grid = trace_picture(tracer, camera, 16, plane, views=64)
    errors = []
    for side in (2, 8, 32):
        made = lens_samples.picture(tracer, camera, 16, lens_samples.lens_points("Halton", side, 0))
        errors.append(np.sqrt(np.square(made - grid).mean()))
    assert errors[0] > 2 * errors[2] and errors[2] < 0.01


def test_a_point():
    reference = np.full((4, 4, 3), 0.5)
    row = point(lambda seed: reference + 0.01, reference, 1e-4, seeds=2, method="m", knob="k")
    assert set(row) == set(COLUMNS) and row["rmse"] == pytest.approx(0.01)
    assert row["repeats"] == 20 and row["quartile_1_seconds"] <= row["seconds"]
    assert row["resolved"] and not point(lambda s: reference + 1e-5, reference, 1e-4)["resolved"]


def test_a_method_that_refuses_is_shown_as_failed():
    def refuse(seed):
        raise OpticsError("no")

    row = point(refuse, np.zeros((2, 2, 3)), None, method="m")
    assert row["rmse"] is None and row["method"] == "m"
    with pytest.raises(ZeroDivisionError):
        point(lambda seed: 1 / 0, np.zeros((2, 2, 3)), None)


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
).assign(scene="s", f_number=1.0, resolved=True, bits_per_ray=[None, None, 0.3, None])  # fmt: skip


def test_recommendation():
    table = recommendation(POINTS, [35, 40, 45, 50]).set_index("target_db")
    assert table.method.tolist()[:3] == ["b", "b", "b"]
    assert table.setting.tolist() == ["N = 8", "N = 8", "N = 9", "none measured reaches it"]
    assert table.psnr_db[50] == 46 and np.isnan(table.seconds[50])


def test_figures_are_made_also_with_failures(tmp_path):
    work_precision(tmp_path / "a.png", POINTS, machine="a machine")
    storage(tmp_path / "b.png", POINTS)
    assert (tmp_path / "a.png").stat().st_size > 5000 < (tmp_path / "b.png").stat().st_size
