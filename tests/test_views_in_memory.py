"""Views of numpy's, xarray's and trimesh's objects, and pickles, in one call each."""

import pickle
import subprocess
import sys

import numpy as np
import pytest
import trimesh
from plain_scenes import refused

import lfcore
from lfcore.colour import srgb_decode

CAMERA = lfcore.Camera(0.05, 0.036, 2.0, 3.0)
EXACT = lfcore.Encoding("ffv1")
RNG = np.random.default_rng(7)


def stored(views, geometry, path):
    return lfcore.LightField.from_views(views, geometry, path, encoding=EXACT)


@pytest.fixture(scope="module")
def codes():
    return RNG.integers(0, 256, (3, 3, 16, 16, 3), np.uint8)


@pytest.fixture(scope="module")
def field(codes, tmp_path_factory):
    return stored(codes, CAMERA, tmp_path_factory.mktemp("views") / "field.mkv")


def test_views_come_back(field, codes):
    assert field.slab == lfcore.Slab(CAMERA, 3, 16) and field.metric
    np.testing.assert_array_equal(field.views(0, 0, 3, 3, codes=True), codes)
    assert field.refocus(3.0, filter="nearest").shape == (16, 16, 3)


def test_light_is_stored_as_light(codes, tmp_path):
    light = srgb_decode(codes)
    field = stored(light, CAMERA, tmp_path / "a.mkv")
    np.testing.assert_allclose(field.view(1, 2), light[2, 1], atol=0.02)
    for wrong in (light * 1e5, light[0], light - 1):
        refused("views", stored, wrong, CAMERA, tmp_path / "b.mkv")
    assert [file.name for file in tmp_path.iterdir()] == ["a.mkv"]


@pytest.mark.parametrize(
    "wrong", ["ragged", np.bool_, np.complex64, object, np.int32, "U3"], ids=str
)
def test_views_of_other_types_are_refused(codes, tmp_path, wrong):
    given = [[1], [2, 3]] if wrong == "ragged" else codes.astype(wrong)
    refused(
        "views: (are|must be)",
        stored,
        given,
        CAMERA,
        tmp_path / "a.mkv",
    )


@pytest.mark.parametrize("shape", [(2, 4, 16, 16), (3, 2, 16, 24)])
def test_grids_that_are_not_square(shape, tmp_path):
    codes = RNG.integers(0, 256, (*shape, 3), np.uint8)
    for geometry, metric in ((CAMERA, True), (0.02, False)):
        field = stored(codes, geometry, tmp_path / f"{metric}.mkv")
        assert field.metric is metric and field.grid == shape[1::-1]
        rows, columns, height, width = shape
        assert field.picture_size == (width, height)
        np.testing.assert_array_equal(field.views(0, 0, columns, rows, codes=True), codes)
    refused("spacing", stored, codes, -1.0, tmp_path / "c.mkv")


def test_camera_arrays_hold_brighter_light(tmp_path):
    array = lfcore.CameraArray.on_grid((3, 3), (-0.1, 0.1, -0.1, 0.1), 40.0, (16, 16))
    image = np.float32(RNG.random((48, 48, 3)) * 3)
    for views in (image, array.tiles(image)):
        field = stored(views, array, tmp_path / "a.mkv")
        assert field.array == array and field.white == pytest.approx(image.max())
    same = lfcore.LightField.from_views(
        array.tiles(image), array, tmp_path / "b.mkv", white=8, name="noise"
    )
    assert same.white == 8 and same.metadata.scene["name"] == "noise"


@pytest.mark.kernels
def test_views_of_a_scene_know_it(tmp_path):
    scene = lfcore.Scene.from_trimesh(trimesh.creation.icosphere(subdivisions=2))
    views = np.zeros((2, 2, 16, 16, 3), np.uint8)
    field = lfcore.LightField.from_views(views, scene.camera, tmp_path / "a.mkv", scene=scene)
    said = lfcore.export_lightfield(field, "hci", tmp_path / "out", scene=scene)
    assert isinstance(said, list) and list((tmp_path / "out").glob("gt_depth*"))


@pytest.mark.parametrize("kind", ["views", "macropixels"])
def test_xarray_is_lazy_with_a_chunk_a_segment(tmp_path, kind, monkeypatch):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("dask.array")
    triangle = [[[-1, -1, 0], [1, -1, 0], [0, 1, 0]]]
    scene = lfcore.Scene.from_triangles(np.float32(triangle))
    encoding = lfcore.Encoding("ffv1", layout=kind, depth=False)
    monkeypatch.setattr("lfcore.rendering.record.TILE_RAYS", 7000)
    field = lfcore.record(scene, tmp_path / "a.mkv", views=6, pixels=24, encoding=encoding)
    assert len(field.segments) > 1
    with lfcore.LightField.open(tmp_path / "a.mkv") as counted:
        made = counted.to_xarray()
        assert isinstance(made, xarray.DataArray) and counted.video.decoded_frames == 0
        assert made.dims == ("row", "column", "y", "x", "channel")
        assert made.shape == (6, 6, 24, 24, 3) and made.dtype == np.float32
        assert made.data.npartitions == len(field.segments)
        assert made.s_m.values == pytest.approx(field.slab.lens_positions())
        whole = made.sel(channel="green").isel(row=5, column=2).values
        np.testing.assert_array_equal(whole, field.view(2, 5)[..., 1])
        np.testing.assert_array_equal(
            counted.to_xarray(codes=True).values, field.views(0, 0, 6, 6, codes=True)
        )
        if kind == "views":
            first = lfcore.LightField.open(tmp_path / "a.mkv")
            first.to_xarray().isel(row=0).compute()
            assert first.video.decoded_segments == {0}


def test_xarray_that_is_missing_is_named(field, monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    refused(r"lfcore\[xarray\]", field.to_xarray)


def test_light_fields_pickle_by_path(field, codes, tmp_path):
    dump = tmp_path / "field.pickle"
    dump.write_bytes(pickle.dumps(field))
    assert dump.stat().st_size < 1000
    program = (
        "import pickle, sys; field = pickle.load(open(sys.argv[1], 'rb'));"
        "print(field.view(1, 0, codes=True).astype(int).sum())"
    )
    words = [sys.executable, "-c", program, str(dump)]
    said = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert int(said) == int(codes[0, 1].astype(int).sum())


def test_other_objects_pickle(field):
    scene = lfcore.Scene.from_trimesh(trimesh.creation.box())
    for thing in (
        CAMERA, field.slab, lfcore.SensorPlane(2.0, 4.0), lfcore.Lattice(4), lfcore.Quality(40),
        EXACT, lfcore.Surface("red"), lfcore.CameraArray.from_slab(field.slab),
    ):  # fmt: skip
        assert repr(pickle.loads(pickle.dumps(thing))) == repr(thing)
    again = pickle.loads(pickle.dumps(scene))
    np.testing.assert_array_equal(again.triangles, scene.triangles)
    device = lfcore.open_device(threads=1)
    again = pickle.loads(pickle.dumps(device))
    assert (again.name, again.threads, again.lanes) == (device.name, 1, device.lanes)


def test_scenes_of_trimesh_are_those_of_its_files(tmp_path):
    red = trimesh.visual.material.PBRMaterial(baseColorFactor=[255, 0, 0, 255], metallicFactor=0.0)
    ball = trimesh.creation.icosphere(subdivisions=1)
    ball.visual = trimesh.visual.TextureVisuals(material=red)
    whole = trimesh.Scene()
    whole.add_geometry(ball)
    whole.add_geometry(trimesh.creation.box(), transform=np.diag([1, 2, 1, 1.0]))
    made = lfcore.Scene.from_trimesh(whole)
    whole.export(tmp_path / "whole.glb")
    read = lfcore.load_scene(tmp_path / "whole.glb", bare=True)
    assert made.triangle_count == read.triangle_count == 92
    corners = [np.sort(scene.triangles.reshape(-1, 3), axis=0) for scene in (made, read)]
    np.testing.assert_allclose(*corners, atol=1e-5)
    reds = [material.diffuse for material in made.materials if material.diffuse[1] == 0]
    assert len(reds) == 1 and reds[0][0] > 0.5
    simple = trimesh.creation.box()
    simple.visual = trimesh.visual.TextureVisuals(
        material=trimesh.visual.material.SimpleMaterial(diffuse=[0, 0, 255, 255])
    )
    (blue,) = lfcore.Scene.from_trimesh(simple).materials
    assert blue.diffuse[2] > 10 * max(blue.diffuse[:2])
    refused("no triangles", lfcore.Scene.from_trimesh, trimesh.Scene())
