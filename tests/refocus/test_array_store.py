"""Camera arrays in the video store: stored, opened, refocused like a slab; slabs as tiled EXR."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from plain_scenes import refused

from lfcore import Camera, CameraArray, Encoding, LightField, OpticsError, Scene, Slab
from lfcore.cli import main
from lfcore.colour import srgb_encode
from lfcore.evaluation.metrics import psnr
from lfcore.exr import read_exr_picture
from lfcore.refocus.shift_sum import shift_sum_views
from lfcore.refocus.stored_views import read_stored
from lfcore.storage.tiled_exr import read_array, write_array

LOSSLESS = Encoding("ffv1", "yuv444p", crf=0, preset=None, tune=None)
# Rounding to 8-bit YCbCr of limited range and back.
CODE = 2 / 255


@pytest.fixture(scope="module")
def array():
    return CameraArray.on_grid((5, 5), (-0.2, 0.2, -0.2, 0.2), 50.0, (24, 24))


@pytest.fixture(scope="module")
def image(array):
    """A smooth wave at 2 m, up to radiance 2.4, as each camera sees it."""
    x, y = array.pixel_tangents()
    s, t = np.array(array.columns_m), np.array(array.rows_m)
    u = (s[:, None] + 2 * x)[None, :, None, :]
    v = (t[:, None] + 2 * y)[:, None, :, None]
    waves = [1.2 + 1.2 * np.sin(3 * u + c) * np.cos(4 * v + 2 * c) for c in range(3)]
    return array.mosaic(np.stack(np.broadcast_arrays(*waves), -1)).astype(np.float32)


@pytest.fixture(scope="module")
def stored(array, image, tmp_path_factory):
    path = tmp_path_factory.mktemp("array") / "lightfield.mkv"
    LightField.from_views(image, array, path, encoding=LOSSLESS)
    return path


def codes(picture, white):
    return srgb_encode(np.asarray(picture, np.float64) / white)


def test_what_comes_back_is_the_array(stored, array, image):
    field = LightField.open(stored)
    assert field.array == array
    assert field.metadata.slab is None and (field.slab.views, field.slab.pixels) == (5, 24)
    assert field.white == pytest.approx(image.max())
    found, again = read_stored(field)
    assert again == array
    assert np.abs(codes(found, field.white) - codes(image, field.white)).max() < CODE
    tile = array.tiles(image)[3, 1]
    assert np.abs(field.view(1, 3, codes=True) / 255 - codes(tile, field.white)).max() < CODE


@pytest.mark.parametrize("filter", ["nearest", "bilinear"])
def test_it_refocuses_like_a_slab(stored, array, image, filter):
    field = LightField.open(stored)
    slab = array.as_slab()
    made = field.refocus(focus_m=2.0, f_number=slab.camera.f_number, filter=filter)
    plane = field.plane(2.0, slab.camera.f_number)
    expected = shift_sum_views(slab, array.tiles(image) / field.white, [plane], filter=filter)[0]
    expected = expected * field.white
    assert psnr(codes(made, 2.4), codes(expected, 2.4), peak=1.0) > 45
    # Focused on the wave, the picture is the wave itself, but for resampling at the border.
    inner = slice(4, -4)
    middle = array.tiles(image)[2, 2][inner, inner]
    assert np.abs(made[inner, inner] - middle).max() < (0.35 if filter == "nearest" else 0.1)


def test_the_slab_of_an_array_has_its_rays():
    slab = Slab(Camera(0.05, 0.036, 2.0, 3.0), 7, 12)
    again = CameraArray.from_slab(slab).as_slab()
    np.testing.assert_allclose(again.lens_positions(), slab.lens_positions(), rtol=1e-12)
    np.testing.assert_allclose(again.pixel_tangents(), slab.pixel_tangents(), rtol=1e-12)
    assert again.camera.delta == pytest.approx(slab.camera.delta)


@pytest.mark.parametrize(
    "array",
    [
        CameraArray.on_grid((5, 5), (-0.2, 0.2, -0.1, 0.1), 50.0, (24, 24)),
        CameraArray.on_grid((5, 5), (-0.2, 0.3, -0.2, 0.2), 50.0, (24, 24)),
        CameraArray.on_grid((5, 4), (-0.2, 0.2, -0.2, 0.2), 50.0, (24, 24)),
        CameraArray.on_grid((5, 5), (-0.2, 0.2, -0.2, 0.2), 50.0, (24, 16)),
        CameraArray((-0.1, 0.0, 0.2), (-0.1, 0.0, 0.2), 50.0, (24, 24)),
    ],
)
def test_what_is_no_slab_says_so(array, tmp_path):
    assert array.as_slab() is None
    image = np.full((*array.image_size[::-1], 3), 0.25, np.float32)
    path = tmp_path / "lightfield.mkv"
    put = partial(LightField.from_views, image, array, path, encoding=LOSSLESS)
    if array.cameras[0] != array.cameras[1] or array.tile[0] != array.tile[1]:
        refused("square", put)
        return
    put()
    refused("imgtool", LightField.open(path).refocus, focus_m=2.0)
    assert read_stored(LightField.open(path))[1] == array


def test_bad_light_is_refused(array, image, tmp_path):
    for bad, white in ((-1.0, None), (np.nan, None), (np.inf, None), (0.5, 0.0)):
        wrong = image.copy()
        wrong[3, 3] = bad
        with pytest.raises(OpticsError):
            LightField.from_views(wrong, array, tmp_path / "x.mkv", white=white)
    assert not list(tmp_path.iterdir())


def run(*words):
    return main(["imgtool", *(str(word) for word in words)])


def test_store_tiles_and_synthesis_on_the_command_line(array, image, tmp_path, capsys):
    exr, mkv, again = (tmp_path / name for name in ("a.exr", "a.mkv", "b.exr"))
    write_array(exr, image, array, extra={"scene": "waves"})
    assert run("store", exr, mkv, "--codec", "ffv1") == 0
    assert run("tiles", mkv, again) == 0
    found = read_array(again)
    assert found.array == array and found.extra == {"scene": "waves"}
    assert np.abs(codes(found.image, 2.4) - codes(image, 2.4)).max() < CODE
    options = ["--focalplanez", 2, "--filterwidth", 0.2, "--outputdim", 16, 16]
    for source, out in ((exr, "x.exr"), (mkv, "y.exr")):
        assert run("lightfield", *options, source, tmp_path / out) == 0
    a, b = (codes(read_exr_picture(tmp_path / out), 2.4) for out in ("x.exr", "y.exr"))
    assert np.abs(a - b).max() < CODE
    assert main(["info", str(mkv)]) == 0
    assert "camera array, 5 x 5" in capsys.readouterr().out
    assert run("store", exr, mkv, "--codec", "ffv1", "--white", 1) == 0
    assert "clipped" in capsys.readouterr().err
    assert run("store", exr, tmp_path / "a.mp4") == 1
    assert run("tiles", exr, again) == 1


def test_a_slabs_views_become_a_tiled_exr(tmp_path):
    mkv, exr = tmp_path / "slab.mkv", tmp_path / "slab.exr"
    words = ["record", "scenes/chart", "-o", str(mkv), "--pixels", "16", "--views", "3"]
    assert main([*words, "--depth", "none", "--codec", "ffv1"]) == 0
    assert run("tiles", mkv, exr) == 0
    found, field = read_array(exr), LightField.open(mkv)
    assert found.array == CameraArray.from_slab(field.slab)
    tiles = found.array.tiles(found.image)
    for i, j in ((0, 0), (2, 1)):
        assert np.abs(srgb_encode(tiles[j, i]) - field.view(i, j, codes=True) / 255).max() < CODE


@pytest.mark.slow
def test_a_light_field_camera_is_traced_into_the_store(tmp_path):
    text = (
        'Camera "lightfield" "float fov" 40 "integer camerasperdim" [3 3]\n'
        'Film "image" "integer xresolution" 48 "integer yresolution" 48\n'
        'Sampler "halton" "integer pixelsamples" 2\nWorldBegin\n'
        'LightSource "infinite" "rgb L" [3 2 1]\nTranslate 0 0 5\nShape "sphere" "float radius" 1\n'
        "WorldEnd\n"
    )
    (tmp_path / "s.pbrt").write_text(text)
    for what, out in (("record", "s.mkv"), ("render", "s.exr")):
        assert main([what, str(tmp_path / "s.pbrt"), "-o", str(tmp_path / out)]) == 0
    field, found = LightField.open(tmp_path / "s.mkv"), read_array(tmp_path / "s.exr")
    assert field.array == found.array and field.white == pytest.approx(3.0)
    assert psnr(codes(read_stored(field)[0], 3), codes(found.image, 3), peak=1.0) > 30
    assert field.refocus(focus_m=5.0).max() == pytest.approx(3.0, rel=0.05)


def test_what_is_in_focus_everywhere_is_as_bright_as_the_scene(tmp_path):
    """A white above 1 is taken back in every picture."""
    wall = [[[-9, -9, 2], [9, -9, 2], [0, 18, 2]]]
    scene = replace(
        Scene.from_triangles(np.float32(wall), camera=Camera(0.05, 0.036, 2.0, 2.0)),
        lights=[], ambient=(0.5, 0.5, 0.5),
    )  # fmt: skip
    slab = Slab(scene.camera, 3, 16)
    array = CameraArray.from_slab(slab)
    image = np.full((*array.image_size[::-1], 3), 0.4, np.float32)
    field = LightField.from_views(image, array, tmp_path / "a.mkv", encoding=LOSSLESS, white=4.0)
    assert field.white == 4
    for made in (field.all_in_focus(scene), field.view(1, 1), field.refocus()):
        np.testing.assert_allclose(made, 0.4, rtol=0.03)
