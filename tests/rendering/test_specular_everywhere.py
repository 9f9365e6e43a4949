"""Wherever rays of mirrors and coats go, they have both parts: compared with traced pictures."""

import json
import pickle
from dataclasses import replace

import numpy as np
import pytest
from mirror_room import CAMERA, PIXELS, mirror_room

import lfcore
from lfcore import Lattice, SensorPlane, Slab
from lfcore.cli import main
from lfcore.colour import srgb_encode
from lfcore.evaluation.metrics import psnr
from lfcore.optics import bundles
from lfcore.optics.plenoptic import PlenopticCamera, sub_aperture
from lfcore.optics.slab import all_samples
from lfcore.pictures import linear_light, read_picture
from lfcore.rendering.direct import trace_planes
from lfcore.rendering.photograph import array_bundles
from lfcore.rendering.plenoptic import photograph
from lfcore.rendering.prepared import open_tracer
from lfcore.storage.tiled_exr import read_array

pytestmark = pytest.mark.kernels
VIEWS = 4
SLAB = Slab(CAMERA, VIEWS, PIXELS)
PLANES = [SensorPlane(4.0, 1.0, "square"), SensorPlane(12.0, 1.0, "square")]


@pytest.fixture(scope="module")
def tracer():
    return open_tracer(replace(mirror_room(), animation=None))


@pytest.fixture(scope="module")
def light(tracer):
    """All light of a plain grid of views, (N, N, H, W, 3), of both parts."""
    rays = bundles.views(SLAB, all_samples(SLAB))
    (own, _), (shown, _) = tracer.parts(rays)
    assert (shown.max(axis=-1) > 0.01).mean() > 0.2 and own[shown.any(-1)].any()
    return (own + shown).reshape(VIEWS, VIEWS, PIXELS, PIXELS, 3)


@pytest.fixture(scope="module")
def plain(tracer, tmp_path_factory):
    """A file with depth of the same rays."""
    path = tmp_path_factory.mktemp("plain") / "plain.mkv"
    lattice = Lattice(VIEWS, 1, displaced=False)
    return lfcore.record(
        tracer.scene, path, views=lattice, pixels=PIXELS, encoding=lfcore.Encoding("ffv1")
    )


@pytest.fixture(scope="module", params=["views", "macropixels"])
def grid(request, tracer, tmp_path_factory):
    """Files without depth of the same rays."""
    encoding = lfcore.Encoding("ffv1", depth=False, layout=request.param)
    path = tmp_path_factory.mktemp("grid") / "grid.mkv"
    return lfcore.record(tracer.scene, path, views=VIEWS, pixels=PIXELS, encoding=encoding)


def is_close(found, expected, most=0.02):
    np.testing.assert_allclose(found, np.clip(expected, 0, 1), atol=most)


def test_files_without_depth_have_the_sum(grid, tracer, light):
    assert grid.specular is None
    is_close(grid.views(0, 0, VIEWS, VIEWS), light)
    is_close(grid.refocus_many(PLANES), trace_planes(tracer, SLAB, PLANES))


def test_views_of_files_with_depth_are_sums(plain, light, tmp_path):
    is_close(plain.views(0, 0, VIEWS, VIEWS), light)
    is_close(pickle.loads(pickle.dumps(plain)).macropixel(9, 12), light[:, :, 12, 9])
    is_close(plain.to_xarray().values, light)
    notes = lfcore.export_lightfield(plain, "json", tmp_path / "all")
    assert any("depth is that of surfaces" in note for note in notes)
    files = json.loads((tmp_path / "all/views.json").read_text())["views"]
    for each in files:
        shown = linear_light(read_picture(tmp_path / "all" / each["file"]))
        is_close(shown, light[each["row"], each["column"]])
    depth = read_picture((tmp_path / "all" / files[5]["file"]).with_suffix(".depth.pfm"))
    assert np.median(depth[12:20, 10:14]) == pytest.approx(4, abs=0.1)  # the mirror


def test_stacks_and_pictures_without_depth_add_both_parts(plain, tracer):
    expected = trace_planes(tracer, SLAB, PLANES)
    is_close(plain.refocus_many(PLANES, filter="nearest"), expected)
    inner = np.s_[:, 6:-6, 6:-6]  # the borders of shifted views differ
    fast = plain.stack([4.0, 12.0], aperture="square", fast=True)
    assert psnr(fast[inner], expected[inner], peak=1) > 27
    np.testing.assert_allclose(fast[inner].mean((1, 2)), expected[inner].mean((1, 2)), atol=0.005)


def test_pictures_focus_where_images_are_and_nothing_doubts_it(plain, capsys, tmp_path):
    assert plain.doubts(PLANES[1]) == [] == plain.doubts(PLANES[0])
    (doubt,) = plain.doubts(SensorPlane(1.5, 1.0))
    assert "surfaces are from 4" in doubt and "images in mirrors and glass from" in doubt
    assert main(["view", str(plain.path), "-o", str(tmp_path / "a.npy"), "--view", "1", "2"]) == 0
    np.testing.assert_array_equal(np.load(tmp_path / "a.npy"), plain.view(1, 2, codes=True))


def test_camera_arrays_and_their_tiles_have_both_parts(plain, tracer, light, tmp_path):
    array = lfcore.CameraArray.from_slab(SLAB)
    rays = array_bundles(array, np.zeros((VIEWS**2, 2)), 1)
    expected = sum(each for each, _ in tracer.parts(rays)).reshape(light.shape)
    is_close(lfcore.trace_array(tracer.scene, array), array.mosaic(expected), 1e-6)
    out = str(tmp_path / "a.exr")
    assert main(["imgtool", "tiles", str(plain.path), "-o", out]) == 0
    is_close(read_array(out).image, array.mosaic(light))


def test_plenoptic_photographs_have_both_parts(tracer):
    camera = PlenopticCamera(CAMERA, lenses=PIXELS, samples=VIEWS)
    picture = photograph(tracer, camera)
    rays = bundles.views(camera.slab(), np.int32([[1, 2]]))
    expected = sum(light for light, _ in tracer.parts(rays))[0]
    found = sub_aperture(picture, VIEWS, 1, 2) / 255.0
    is_close(found, srgb_encode(np.clip(expected, 0, 1)), 0.03)
