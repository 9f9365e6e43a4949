"""The scene's own film, and camera arrays: against analytic scenes and the tracer's visibility."""

from dataclasses import replace

import numpy as np
import pytest
from plain_scenes import in_even_light, refused

from lfcore import CameraArray, Device, open_device
from lfcore.cli import main
from lfcore.exr import read_exr_picture
from lfcore.readers.pbrt.build import build_pbrt_scene
from lfcore.refocus.array.virtual_camera import VirtualCamera
from lfcore.rendering.photograph import (
    array_bundles,
    direct_thin_lens,
    photograph,
    shutter_times,
    stratified_offsets,
    trace_array,
    trace_shutter,
)
from lfcore.rendering.prepared import open_tracer
from lfcore.storage.tiled_exr import read_array
from lfcore.tracing import arrays

pytestmark = pytest.mark.kernels

SCENE = """
Camera %s
Film "image" "integer xresolution" [48] "integer yresolution" [32]
Sampler "random" "integer pixelsamples" [%d]
WorldBegin
LightSource "infinite" "rgb L" [1 1 1]
AttributeBegin
    ActiveTransform EndTime Translate 2 0 0 ActiveTransform All
    Material "matte" "rgb Kd" [1 0.5 0.25]
    Shape "trianglemesh" "integer indices" [0 1 2 0 2 3]
        "point P" [-2 -1 2  0 -1 2  0 1.5 2  -2 1.5 2]
AttributeEnd
Material "matte" "rgb Kd" [0.1 0.1 0.1]
Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point P" [-9 -9 5  9 -9 5  9 9 5  -9 9 5]
WorldEnd
"""
STILL = '"float shutterclose" [0]'
LENS = f'"perspective" "float fov" [60] "float lensradius" [0.2] "float focaldistance" [2] {STILL}'
ARRAY = '"lightfield" "float fov" [70] "integer camerasperdim" [3 2]'


@pytest.fixture
def scene(tmp_path):
    """A function that reads the scene with a camera and a number of rays a pixel."""

    def read(camera, samples=4):
        (tmp_path / "scene.pbrt").write_text(SCENE % (camera, samples))
        return in_even_light(build_pbrt_scene(tmp_path / "scene.pbrt"))

    return read


def test_a_thin_lens_is_traced_at_its_focus(scene):
    made = scene(LENS, 64)
    camera = VirtualCamera(np.zeros(3), np.eye(3), 60.0, (48, 32), 0.2)
    picture = photograph(made)
    np.testing.assert_array_equal(picture, direct_thin_lens(open_tracer(made), camera, 2.0, 64))
    # The square is in focus, so its edges are sharp; its right one passes through the middle.
    assert picture.shape == (32, 48, 3)
    np.testing.assert_allclose(picture[16, [22, 25]], [[1, 0.5, 0.25], [0.1, 0.1, 0.1]], atol=1e-5)


def test_a_pinhole_and_an_array_are_traced_as_arrays(scene):
    for camera in (f'"perspective" {STILL}', f"{ARRAY} {STILL}"):
        made = scene(camera)
        expected = trace_array(open_tracer(made), made.view.array, 4)
        np.testing.assert_array_equal(photograph(made), expected)
    refused("samples_per_pixel", photograph, made, 0)


def test_a_moving_square_smears_into_a_ramp(scene):
    """It moves by its own width: a triangle of exposure, sampled at 8 instants."""
    made = scene('"perspective" "float fov" 90')
    picture = (trace_shutter(made, made.view.array, 8)[16, :, 0] - 0.1) / 0.9
    x = 2 * made.view.array.pixel_tangents()[0]
    left = -2 + 2 * shutter_times(8)[:, None]
    expected = ((x >= left) & (x < left + 2)).mean(0)
    np.testing.assert_allclose(picture, expected, atol=0.126)
    assert np.abs(picture - expected).mean() < 0.01
    assert picture[24] > 0.8 and 0.3 < picture[16] < 0.7 and 0.3 < picture[32] < 0.7


def test_instants_lie_in_their_intervals():
    assert (np.floor(shutter_times(10) * 10) == np.arange(10)).all()
    refused("times", shutter_times, 0)


def test_the_shutter_says_how_far_things_move(scene, tmp_path):
    """Open until half of the motion: as far as a scene that moves half as far."""
    half = photograph(scene(ARRAY + ' "float shutterclose" [0.5]', 8))
    text = SCENE.replace("Translate 2 0 0", "Translate 1 0 0")
    whole, file = scene(ARRAY, 8), tmp_path / "scene.pbrt"
    file.write_text(text % (ARRAY, 8))
    np.testing.assert_allclose(half, photograph(in_even_light(build_pbrt_scene(file))), atol=1e-6)
    file.write_text("TransformTimes 0 2\n" + SCENE % (ARRAY, 8))
    np.testing.assert_allclose(half, photograph(in_even_light(build_pbrt_scene(file))), atol=1e-6)
    assert np.abs(half - photograph(whole)).max() > 0.1


def test_render_writes_film_and_geometry(scene, tmp_path):
    made = scene(f"{ARRAY} {STILL}")
    out, file = tmp_path / "field.exr", str(tmp_path / "scene.pbrt")
    assert main(["render", file, "-o", str(out)]) == 0
    found = read_array(out)
    assert found.array == made.view.array and found.extra["shutter"] == [0, 0]
    np.testing.assert_array_equal(
        found.image, photograph(build_pbrt_scene(tmp_path / "scene.pbrt"))
    )
    assert main(["render", file, "-o", str(tmp_path / "x.exr"), "--pixels", "16"]) == 0
    assert read_exr_picture(tmp_path / "x.exr").shape == (16, 16, 3)


def test_options_of_film_and_slab_exclude_each_other(scene, tmp_path, capsys):
    scene(ARRAY)
    out = str(tmp_path / "x.exr")
    file = str(tmp_path / "scene.pbrt")
    assert main(["render", file, "-o", out, "--samples", "2", "--views", "3"]) == 1
    for other in (["--dual-pixel"], ["--aperture", "square"]):
        assert main(["render", file, "-o", out, "--samples", "2", *other]) == 1
    assert main(["render", "scenes/sphere", "-o", out, "--samples", "2"]) == 1
    said = capsys.readouterr().err
    assert "--samples" in said and "film" in said


@pytest.fixture
def traced(scene):
    """The scene before an array of cameras, and its tracer."""
    made = scene(f"{ARRAY} {STILL}")
    return made, open_tracer(made)


def test_every_tile_is_what_its_camera_sees(traced):
    """Colours from exact geometry: the square, then the wall."""
    array = traced[0].view.array
    tiles = array.tiles(trace_array(traced[1], array))
    for j, i in np.ndindex(2, 3):
        x, y, _ = np.moveaxis(array.origins()[j, i] + 2 * array.directions(i, j), -1, 0)
        square = (x > -2) & (x < 0) & (y > -1.5) & (y < 1)  # pbrt's y is up
        expected = np.where(square[..., None], [1, 0.5, 0.25], [0.1] * 3)
        np.testing.assert_allclose(tiles[j, i], expected, atol=1e-5)
        assert square.any() and not square.all()


def test_samples_average_over_the_pixel(traced):
    """More samples approach the pixel's mean along the edge, where one sample is square or wall."""
    tracer = traced[1]
    array = CameraArray((0.12,), (-0.07,), 60.0, (24, 24))
    fine = trace_array(tracer, replace(array, tile=(384, 384)))
    mean = fine.reshape(24, 16, 24, 16, 3).mean((1, 3))
    errors = [
        np.sqrt(np.mean((trace_array(tracer, array, count, seed=3) - mean) ** 2))
        for count in (1, 4, 16, 64)
    ]
    assert errors[3] < errors[2] < errors[1] < errors[0]
    assert errors[3] < 0.2 * errors[0]
    again = trace_array(tracer, array, 16, seed=3)
    np.testing.assert_array_equal(again, trace_array(tracer, array, 16, seed=3))


@pytest.mark.parametrize(
    "tile, samples, lanes",
    [((64, 48), 1, None), ((64, 33), 3, None), ((41, 30), 2, None), ((16, 16), 1, None),
     ((7, 9), 2, None), ((64, 33), 3, 4), ((7, 9), 2, 4)],
)  # fmt: skip
def test_the_image_is_what_cameras_one_by_one_give(traced, monkeypatch, tile, samples, lanes):
    device = open_device(lanes=lanes)
    tracer = open_tracer(traced[0], device)
    array = CameraArray.on_grid((5, 3), (-0.3, 0.3, -0.2, 0.2), 60.0, tile)
    offsets = stratified_offsets(15, samples, 0)
    grid = np.stack(np.meshgrid(np.arange(5), np.arange(3)), -1).reshape(-1, 2)
    total = np.zeros((15, tile[1], tile[0], 3), np.float32)
    for offset in offsets:
        total += tracer.bundle_radiance(array_bundles(array, offset, samples), grid)
    expected = array.mosaic((total / np.float32(samples)).reshape(3, 5, tile[1], tile[0], 3))
    np.testing.assert_array_equal(trace_array(tracer, array, samples), expected)
    # As on a device with memory of its own: rows of tiles at a time, copied back.
    monkeypatch.setattr(Device, "is_cpu", False)
    monkeypatch.setattr(arrays, "DEVICE_RAYS", 1)
    np.testing.assert_array_equal(trace_array(tracer, array, samples), expected)


def test_offsets_hold_one_sample_in_each_stratum():
    offsets = stratified_offsets(50, 16, 7) + 0.5
    cells = np.floor(offsets * 4).astype(int)
    assert (np.sort(cells[..., 1] * 4 + cells[..., 0], 0) == np.arange(16)[:, None]).all()
    assert not stratified_offsets(3, 1, 0).any()
