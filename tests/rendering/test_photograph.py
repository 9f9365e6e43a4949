"""The scene's own film: pinhole, thin lens, camera array, shutter; ``lfcore render`` of it."""

import numpy as np
import pytest

from lfcore.cli import main
from lfcore.errors import OpticsError
from lfcore.exr import read_exr_picture
from lfcore.refocus.array.virtual_camera import VirtualCamera
from lfcore.rendering.array import trace_array
from lfcore.rendering.photograph import direct_thin_lens, photograph
from lfcore.rendering.prepared import open_tracer
from lfcore.rendering.shutter import shutter_times, trace_shutter
from lfcore.scene.pbrt import build_pbrt_scene
from lfcore.storage.tiled_exr import read_array

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
    Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point P" [-2 -1 2  0 -1 2  0 1 2  -2 1 2]
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
        return build_pbrt_scene(tmp_path / "scene.pbrt")

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
    for seed in (None, 3):
        assert (np.floor(shutter_times(10, seed) * 10) == np.arange(10)).all()
    with pytest.raises(OpticsError, match="times"):
        shutter_times(0)


def test_no_samples_are_refused(scene):
    with pytest.raises(OpticsError, match="samples_per_pixel"):
        photograph(scene(ARRAY), 0)


def test_the_shutter_says_how_far_things_move(scene):
    """Open until half of the motion: as far as a scene that moves half as far."""
    half = photograph(scene(ARRAY + ' "float shutterclose" [0.5]', 8))
    text = SCENE.replace("Translate 2 0 0", "Translate 1 0 0")
    whole = scene(ARRAY, 8)
    file = whole.notes[0].file
    file.write_text(text % (ARRAY, 8))
    np.testing.assert_allclose(half, photograph(build_pbrt_scene(file)), atol=1e-6)
    file.write_text("TransformTimes 0 2\n" + SCENE % (ARRAY, 8))
    np.testing.assert_allclose(half, photograph(build_pbrt_scene(file)), atol=1e-6)
    assert np.abs(half - photograph(whole)).max() > 0.1


def test_render_writes_film_and_geometry(scene, tmp_path):
    made = scene(f"{ARRAY} {STILL}")
    out, file = tmp_path / "field.exr", str(tmp_path / "scene.pbrt")
    assert main(["render", file, "-o", str(out)]) == 0
    found = read_array(out)
    assert found.array == made.view.array and found.extra["shutter"] == [0, 0]
    np.testing.assert_array_equal(found.image, photograph(made))
    assert main(["render", file, "-o", str(tmp_path / "x.exr"), "--pixels", "16"]) == 0
    assert read_exr_picture(tmp_path / "x.exr").shape == (16, 16, 3)


def test_options_of_film_and_slab_exclude_each_other(scene, tmp_path, capsys):
    scene(ARRAY)
    out = str(tmp_path / "x.exr")
    file = str(tmp_path / "scene.pbrt")
    assert main(["render", file, "-o", out, "--samples", "2", "--views", "3"]) == 1
    assert main(["render", "scenes/sphere", "-o", out, "--samples", "2"]) == 1
    said = capsys.readouterr().err
    assert "--samples" in said and "film" in said
