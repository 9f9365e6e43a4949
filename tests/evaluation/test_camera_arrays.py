"""Measurements on camera arrays: the direct thin lens against explicit rays, slopes, tables."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfcore import CameraArray, LfcoreError, OpticsError
from lfcore.errors import SceneError
from lfcore.evaluation.assignment.arrays import array_of, errors, overview, square_field
from lfcore.evaluation.assignment.reconstruction import convergence, reconstructions, slope
from lfcore.evaluation.stability.tested_tracer import bare_scene
from lfcore.optics.lens_system import LensSystem
from lfcore.refocus.array.virtual_camera import VirtualCamera
from lfcore.rendering.array import trace_array
from lfcore.rendering.photograph import direct_thin_lens
from lfcore.rendering.prepared import open_tracer
from lfcore.scene.pbrt import build_pbrt_scene
from lfcore.scene.view import lightfield_view

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
BOUNDS = (-0.4, 0.4, -0.4, 0.4)


@pytest.fixture(scope="module")
def tracer(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "s.pbrt"
    path.write_text(SCENE)
    return open_tracer(build_pbrt_scene(path))


def lens_camera(z=0.0, radius=0.2, size=(32, 24)):
    return VirtualCamera([0.05, -0.03, z], np.eye(3), 50.0, size, radius)


@pytest.mark.kernels
def test_a_closed_lens_is_a_pinhole(tracer):
    camera = VirtualCamera([0.1, 0.05, 0.0], np.eye(3), 50.0, (32, 32))
    direct = direct_thin_lens(tracer, camera, 3.0, 64)
    pinhole = trace_array(tracer, CameraArray((0.1,), (0.05,), 50.0, (32, 32)), 64)
    assert np.abs(direct - pinhole).mean() < 0.004


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
        field = square_field(tracer, cameras, BOUNDS, 60.0, 64, 4)
        rows = reconstructions(field, camera, 4.0, reference, (64,))
        found[cameras] = {(row["method"], row["filter_or_samples"]): row for row in rows}
        assert {row["cameras_per_dim"] for row in rows} == {cameras}
    for key in (("monte_carlo", "64"), ("quadrature", "256")):
        assert found[16][key]["rmse"] < 0.7 * found[2][key]["rmse"]
        assert found[16][key]["psnr_db"] > 25
    # The cone is not the disk: more cameras do not mend that.
    assert found[16]["isaksen", "0.2 m"]["rmse"] > found[16]["quadrature", "256"]["rmse"]


def test_monte_carlo_converges_at_its_rate(tracer):
    field = square_field(tracer, 8, BOUNDS, 60.0, 48, 1)
    counts, sampler = (4, 16, 64, 256), "independent"
    found = convergence(field, lens_camera(), 3.0, counts)[sampler]
    assert -0.6 < found["slope"] < -0.4
    assert found["rmse"] == sorted(found["rmse"], reverse=True)


@given(power=st.floats(-3, 3), scale=st.floats(0.01, 100))
def test_the_slope_of_a_power(power, scale):
    counts = [2, 4, 32]
    assert slope(counts, [scale * n**power for n in counts]) == pytest.approx(power, abs=1e-9)


def test_what_has_no_slope():
    for counts, values in (((4, 4), (1.0, 1.0)), ((1, 2), (1.0, 0.0))):
        with pytest.raises(LfcoreError, match="slope"):
            slope(counts, values)


def test_what_is_no_direct_lens(tracer):
    with pytest.raises(OpticsError, match="focus_z"):
        direct_thin_lens(tracer, lens_camera(2.0), 1.0, 4)
    with pytest.raises(OpticsError, match="samples_per_pixel"):
        direct_thin_lens(tracer, lens_camera(), 4.0, 0)
    turned = VirtualCamera.from_pbrt((0, 0, 0), (0, 5, 0), 50.0, (8, 8))
    with pytest.raises(OpticsError, match="rotation"):
        direct_thin_lens(tracer, turned, 4.0, 4)


def test_errors_of_known_pictures():
    black, grey = np.zeros((12, 12, 3)), np.full((12, 12, 3), 0.5)
    found = errors(grey, black)
    assert found["rmse"] == pytest.approx(0.5)
    assert found["psnr_db"] == pytest.approx(20 * np.log10(1 / 0.735357), abs=1e-3)


def test_an_overview_averages():
    image = np.random.default_rng(1).random((8, 12, 3)).astype(np.float32)
    small = overview(image, 5)
    assert small.shape == (2, 4, 3)
    np.testing.assert_allclose(small[1, 2], image[3:6, 6:9].mean((0, 1)), rtol=1e-5)
    np.testing.assert_array_equal(overview(image, 40), image)
    with pytest.raises(LfcoreError, match="picture_px"):
        overview(image, 0)


GRID = {"bounds_m": [-1, 1, -2, 2], "fov_deg": 40}
LENS = Path(__file__).parents[2] / "scenes" / "lenses" / "double_gauss.dat"


def scene(**changes):
    return bare_scene(np.zeros((0, 3, 3)), **changes)


def test_a_scene_without_an_array_takes_the_grid():
    array = array_of(scene(), GRID, 4, 32)
    assert array.cameras == (4, 4) and array.tile == (32, 32) and array.fov_deg == 40
    assert (array.columns_m[0], array.rows_m[0]) == (-1, -2)


def test_a_scene_s_own_array_goes_first():
    own = scene(view=lightfield_view((60, 40), 50.0, (6, 4)))
    for grid in (None, GRID):
        assert array_of(own, grid, 16, None) == own.view.array
    assert array_of(own, None, 16, 32) == replace(own.view.array, tile=(32, 32))


def test_no_array_at_all():
    with pytest.raises(SceneError, match=r"has no camera array.*assignment\.arrays"):
        array_of(scene(), None, 16, 64)


def test_a_lens_stopped_down_has_a_larger_f_number():
    lens = LensSystem.read(LENS).focused(math.inf)
    stop = 2 * float(lens.aperture_m[lens.radius_m == 0][0])
    half, quarter = (lens.stopped_down(stop / part).working_f_number for part in (2, 4))
    assert quarter == pytest.approx(2 * half, rel=0.05)
    # Wide open other surfaces cut the cone, so that closing by one stop closes less.
    assert lens.working_f_number < half < 2 * lens.working_f_number
