"""What our pictures stand beside: camera arrays, plenoptic cameras, other renderers."""

import sys
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from plain_scenes import SCENES, in_even_light, refused

from lfcore import CameraArray, SensorPlane, load_scene
from lfcore.evaluation.assignment.arrays import array_of, errors, square_field
from lfcore.evaluation.assignment.reconstruction import convergence, reconstructions, slope
from lfcore.evaluation.equivalence import equivalence
from lfcore.evaluation.figures import shrunk
from lfcore.evaluation.plenoptic_figure import panels, plenoptic_sheet, take
from lfcore.evaluation.renderers import comparison, povray
from lfcore.evaluation.stability.tested_tracer import bare_scene
from lfcore.evaluation.table_files import table_of
from lfcore.pictures import write_picture
from lfcore.readers.pbrt.build import build_pbrt_scene
from lfcore.refocus.array.virtual_camera import VirtualCamera
from lfcore.rendering.photograph import direct_thin_lens, trace_array
from lfcore.rendering.prepared import open_tracer
from lfcore.scene.view import lightfield_view

PLANES = [SensorPlane(1.33, 1.0), SensorPlane(1.2, 1.4, "square"), SensorPlane(1.6, 1.0)]


@pytest.fixture(scope="module")
def result(chart):
    return equivalence(chart, PLANES, views=16, pixels=64, reference_views=32)


def of(result, method, filter):
    found = [m for m in result[1] if m.method.startswith(method) and m.filter == filter]
    assert len(found) == 1
    return found[0].pictures


@pytest.mark.kernels
def test_one_filter_makes_one_picture_and_the_table_is_whole(result):
    """Slicing, views and photograph see the same rays: only 8-bit frames lie between."""
    slicing = of(result, "slicing", "nearest")
    for method in ("shift-sum on views", "shift-sum on the plenoptic"):
        difference = np.abs(of(result, method, "nearest") - slicing)
        assert difference.max() < 0.015
        assert difference.mean() < 0.002
    bilinear = [of(result, f"shift-sum on {what}", "bilinear") for what in ("views", "the p")]
    assert np.abs(bilinear[0] - bilinear[1]).max() < 0.015
    table = pd.DataFrame(result[0])
    assert len(table) == 3 * 6
    ours = table[table.method != "traced directly"]
    assert (ours.psnr_db > 20).all() and (ours.psnr_inside_db > 26).all()
    assert ours.ssim.between(0.5, 1).all()
    # Errors of resampling gather at edges; at the recorded focus nothing is resampled.
    assert (ours[ours.focus_m != 1.33].error_at_edges > 0.1).all()
    assert (table.seconds > 0).all()
    own = table[table.method == "traced directly"]
    assert np.isinf(own.psnr_db).all() and (own.rays_per_pixel == 1024).all()
    # At the recorded focus nothing has to be resampled: only the number of rays differs.
    assert (ours[ours.focus_m == 1.33].psnr_db > 30).all()
    assert all((one.pictures != result[1][0].pictures).any() for one in result[1][1:])


@pytest.fixture(scope="module")
def pictures(chart):
    return [take(chart, focus, 64, 8) for focus in (2.0, 1.33)]


def spread(picture):
    """How much the pixels of a microlens differ, over the upper half, where the far plane is."""
    cells = picture[: len(picture) // 2].astype(float)
    cells = cells.reshape(-1, 8, 64, 8, 3)
    return cells.std(axis=(1, 3)).mean()


@pytest.mark.kernels
def test_a_microlens_in_focus_is_of_one_colour(pictures):
    (camera, in_focus), (other, out_of_focus) = pictures
    assert in_focus.shape == (512, 512, 3)
    # What differs in focus are the nearer plane's edge and 8-bit codes.
    assert spread(in_focus) < 0.25 * spread(out_of_focus)
    assert camera.camera.field_width == pytest.approx(other.camera.field_width)


def test_sheet_and_whole_photograph(pictures, chart, tmp_path):
    row = panels(chart, *pictures[1], (1.0, 2.0))
    assert len(row) == 6
    # Refocused, the text of the far plane comes back.
    shown = row[5][0], row[0][0]
    sharp, blurred = (np.abs(np.diff(p[:32].mean(-1), axis=1)).mean() for p in shown)
    assert sharp > 1.3 * blurred
    plenoptic_sheet(tmp_path / "sheet.png", [row])
    assert Image.open(tmp_path / "sheet.png").width > 6 * 384
    write_picture(tmp_path / "photo.png", pictures[1][1])
    assert np.array_equal(np.asarray(Image.open(tmp_path / "photo.png")), pictures[1][1])


@pytest.mark.kernels
def test_missing_renderers_are_left_out_aloud(monkeypatch, chart, tmp_path):
    monkeypatch.setattr(povray.shutil, "which", lambda name: None)
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    rows, rendered = comparison.compare(chart, (1.0, 2.0), pixels=32, views=4)
    table = table_of(rows)
    assert len(table) == 8
    missing = table[table.method.isin(["POV-Ray", "Mitsuba 3"])]
    assert missing.note.str.startswith("left out").all() and missing.psnr_db.isna().all()
    assert missing.note.str.contains("not installed").all()
    ours = table[table.method.str.startswith("lfcore")]
    assert (ours.psnr_db > 20).all() and (ours.mrays_per_second > 0).all()
    # Rays spread over the pixels are nearer the reference.
    assert ours.psnr_db.iloc[1] > ours.psnr_db.iloc[0]
    comparison.renderers_sheet(tmp_path / "sheet.png", rendered, (1.0, 2.0))
    with Image.open(tmp_path / "sheet.png") as sheet:
        assert sheet.width < 2.5 * 256 and sheet.height > 4 * 256


# A bright and a dark half of a wall at z = 4, a red bar before it at z = 2; ambient light alone.
SCENE = """
Camera "perspective" "float fov" 60
Film "image" "integer xresolution" [32] "integer yresolution" [32]
WorldBegin
LightSource "infinite" "rgb L" [1 1 1]
Material "matte" "rgb Kd" [.9 .9 .9]
Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point P" [0 -9 4  9 -9 4  9 9 4  0 9 4]
Material "matte" "rgb Kd" [.1 .1 .1]
Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point P" [-9 -9 4  0 -9 4  0 9 4  -9 9 4]
Material "matte" "rgb Kd" [.8 0 0]
Shape "trianglemesh" "integer indices" [0 1 2 0 2 3]
    "point P" [-.5 -9 2  -.3 -9 2  -.3 9 2  -.5 9 2]
WorldEnd
"""
ARRAYS = {"bounds_m": (-0.4, 0.4, -0.4, 0.4), "fov_deg": 60.0}


@pytest.fixture(scope="module")
def tracer(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "s.pbrt"
    path.write_text(SCENE)
    return open_tracer(in_even_light(build_pbrt_scene(path)))


def lens_camera(z=0.0, radius=0.2, size=(32, 24)):
    return VirtualCamera([0.05, -0.03, z], np.eye(3), 50.0, size, radius)


@pytest.mark.kernels
@pytest.mark.parametrize("textured", [False, True])
def test_a_closed_lens_is_a_pinhole(tracer, textured):
    tracer = open_tracer(load_scene(SCENES / "book")) if textured else tracer
    camera = VirtualCamera([0.1, 0.05, 0.0], np.eye(3), 50.0, (32, 32))
    direct = direct_thin_lens(tracer, camera, 3.0, 64)
    pinhole = trace_array(tracer, CameraArray((0.1,), (0.05,), 50.0, (32, 32)), 64)
    assert np.abs(direct - pinhole).mean() < (0.006 if textured else 0.004)


@pytest.mark.parametrize("z", [0.0, -1.0])
def test_a_point_out_of_focus_is_blurred_by_similar_triangles(tracer, z):
    """The edge of the wall at 4 m, focus at 2 m, radius 0.2 m: blurred by similar triangles."""
    camera, blur = VirtualCamera([0.6, 0.0, z], np.eye(3), 20.0, (65, 65), 0.2), 0.4 / (2 - z)
    row = direct_thin_lens(tracer, camera, 2.0, 1024)[32, :, 1]
    # Where on the wall the central ray of each pixel arrives, metres from the edge.
    offset = 0.6 + (4 - z) * camera.film_tangents(np.arange(65) + 0.5, 0.5)[0]
    share = np.clip(offset / blur, -1, 1)
    expected = 0.1 + 0.8 * (0.5 + (share * np.sqrt(1 - share**2) + np.arcsin(share)) / np.pi)
    assert (offset < -0.05).any() and (offset > 0.3).any()
    np.testing.assert_allclose(row, expected, atol=0.02)


def test_more_cameras_come_closer_to_the_lens(tracer):
    camera = lens_camera()
    reference = direct_thin_lens(tracer, camera, 4.0, 256)
    found = {}
    for cameras in (2, 16):
        field = square_field(tracer, ARRAYS, cameras, 64, 4)
        rows = reconstructions(field, camera, 4.0, reference, (64,))
        found[cameras] = {(row["method"], row["filter_or_samples"]): row for row in rows}
        assert {row["cameras_per_dim"] for row in rows} == {cameras}
    for key in (("monte_carlo", "64"), ("quadrature", "256")):
        assert found[16][key]["rmse"] < 0.7 * found[2][key]["rmse"]
        assert found[16][key]["psnr_db"] > 25
    # The cone is not the disk: more cameras do not mend that.
    assert found[16]["isaksen", "0.2 m"]["rmse"] > found[16]["quadrature", "256"]["rmse"]


def test_monte_carlo_converges_at_its_rate(tracer):
    field = square_field(tracer, ARRAYS, 8, 48, 1)
    counts, sampler = (4, 16, 64, 256), "independent"
    found = convergence(field, lens_camera(), 3.0, counts)[sampler]
    assert -0.6 < found["slope"] < -0.4
    assert found["rmse"] == sorted(found["rmse"], reverse=True)


@given(power=st.floats(-3, 3), scale=st.floats(0.01, 100))
def test_the_slope_of_a_power(power, scale):
    counts = [2, 4, 32]
    assert slope(counts, [scale * n**power for n in counts]) == pytest.approx(power, abs=1e-9)


def test_what_is_no_direct_lens(tracer):
    refused("focus_z", direct_thin_lens, tracer, lens_camera(2.0), 1.0, 4)
    refused("samples_per_pixel", direct_thin_lens, tracer, lens_camera(), 4.0, 0)
    turned = VirtualCamera.from_pbrt((0, 0, 0), (0, 5, 0), 50.0, (8, 8))
    refused("rotation", direct_thin_lens, tracer, turned, 4.0, 4)


def test_errors_and_smaller_pictures_are_known():
    black, grey = np.zeros((12, 12, 3)), np.full((12, 12, 3), 0.5)
    found = errors(grey, black)
    assert found["rmse"] == pytest.approx(0.5)
    assert found["psnr_db"] == pytest.approx(20 * np.log10(1 / 0.735357), abs=1e-3)
    image = np.random.default_rng(1).random((8, 12, 3)).astype(np.float32)
    small = shrunk(image, 6)
    assert small.shape == (4, 6, 3)
    np.testing.assert_allclose(small[1, 2], image[2:4, 4:6].mean((0, 1)), rtol=1e-5)
    np.testing.assert_array_equal(shrunk(image, 40), image)


GRID = {"bounds_m": [-1, 1, -2, 2], "fov_deg": 40}


def scene(**changes):
    return bare_scene(np.zeros((0, 3, 3)), **changes)


def test_a_scene_s_own_array_goes_before_the_grid():
    array = array_of(scene(), GRID, 4, 32)
    assert array.cameras == (4, 4) and array.tile == (32, 32) and array.fov_deg == 40
    assert (array.columns_m[0], array.rows_m[0]) == (-1, -2)
    own = scene(view=lightfield_view((60, 40), 50.0, (6, 4)))
    for grid in (None, GRID):
        assert array_of(own, grid, 16, None) == own.view.array
    assert array_of(own, None, 16, 32) == replace(own.view.array, tile=(32, 32))
    refused(r"has no camera array.*assignment\.arrays", array_of, scene(), None, 16, 64)
