"""The library as README shows it: from a model to pictures, without the command line."""

import inspect
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from plain_scenes import refused

import lfcore
from lfcore.cli import main
from lfcore.colour import srgb_encode
from lfcore.optics.size import Size


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    path = tmp_path_factory.mktemp("api") / "model.glb"
    trimesh.creation.icosphere(subdivisions=2).export(path)
    return path


@pytest.fixture(scope="module")
def recorded(model):
    scene = lfcore.load_scene(model, bare=True)
    seen = []
    field = lfcore.record(
        scene, model.with_suffix(".mkv"), views=4, pixels=32, f_number=2,
        encoding=lfcore.Encoding("ffv1", depth=False),
        progress=lambda done, total: seen.append((done, total)),
    )  # fmt: skip
    assert seen[-1][0] == seen[-1][1]
    return scene, field


def test_a_light_field_of_a_model(recorded, tmp_path):
    scene, lf = recorded
    focus = scene.camera.focus_m
    picture = lf.refocus(focus_m=focus, f_number=2)
    assert picture.shape == (32, 32, 3) and picture.dtype == np.float32
    same_rays = {"pixels": 32, "views": 4, "filter": "nearest"}
    traced = lfcore.render(scene, focus_m=focus, f_number=2, **same_rays)
    assert np.abs(picture - traced).max() < 0.02  # colours pass as 8-bit YCbCr
    assert traced[16, 16].mean() > traced[0, 0].mean() + 0.05
    assert lf.view(1, 2).shape == (32, 32, 3) and lf.macropixel(16, 16).shape == (4, 4, 3)
    stack = lf.stack([0.8 * focus, focus], [2.0, 4.0])
    assert stack.shape == (4, 32, 32, 3)
    np.testing.assert_array_equal(stack[2], picture)
    depth = lf.depth(scene)
    assert depth.shape == (16, 32, 32)
    ball = depth[5][np.isfinite(depth[5])]
    assert 0 < ball.min() < ball.max() and np.isinf(depth[5][0, 0])
    sharp = lf.all_in_focus(scene)
    assert sharp.shape == (32, 32, 3) and sharp[16, 16].mean() > 0.05
    lfcore.write_picture(tmp_path / "near.png", picture)
    assert (tmp_path / "near.png").read_bytes().startswith(b"\x89PNG")


def test_several_pictures_from_the_same_rays(recorded):
    scene, lf = recorded
    focus = scene.camera.focus_m
    planes = [lf.plane(0.9 * focus), lf.plane(1.1 * focus, 4.0, "square")]
    together = lfcore.render(scene, planes=planes, pixels=32, views=4, filter="nearest")
    assert together.shape == (2, 32, 32, 3)
    np.testing.assert_allclose(together, lf.refocus_many(planes), atol=0.02)
    refused("no planes", lfcore.render, scene, planes=[])


def test_rays_count_by_their_depth_unless_asked_otherwise(recorded):
    scene, lf = recorded
    planes = [lf.plane(0.8 * scene.camera.focus_m), lf.plane(scene.camera.focus_m)]
    few = lfcore.render(scene, planes=planes, pixels=24, views=4)
    many = lfcore.render(scene, planes=planes, pixels=24, views=32, filter="nearest")
    inner = np.s_[:, 4:-4, 4:-4]
    assert np.sqrt(np.mean((few - many)[inner] ** 2)) < 0.02
    alone = lfcore.render(scene, planes=planes[1:], pixels=24, views=4)
    assert np.sqrt(np.mean((few[1:] - alone)[inner] ** 2)) < 0.01
    refused("unknown filter 'cubic'", lfcore.render, scene, pixels=8, filter="cubic")
    wrong = {"filter": "nearest", "views": lfcore.Lattice(2, 0.5, displaced=False)}
    refused("pixels: a picture of 8 pixels is finer", lfcore.render, scene, pixels=8, **wrong)
    refused("subpixels: must be above 0", lfcore.Lattice, 8, float("nan"))


def test_rays_of_a_pixel_by_default():
    from lfcore import Lattice
    from lfcore.rendering.defaults import lattice_to_store, lattice_to_trace

    plain = Lattice(32, 1, displaced=False)
    assert lattice_to_store(None, None) == (True, Lattice(4, 2))
    assert lattice_to_store(None, 36) == lattice_to_store(True, np.int64(36)) == (True, Lattice(6))
    assert lattice_to_store(None, 3) == lattice_to_store(None, 16) == (True, Lattice(4))
    assert lattice_to_store(False, 32) == (False, plain)
    assert lattice_to_store(None, plain) == (True, plain)
    assert lattice_to_store(False, plain) == (False, plain)
    assert lattice_to_store(False, None) == (False, Lattice(16, 1, displaced=False))
    assert lattice_to_trace("depth", None) == Lattice(4, 2)
    assert lattice_to_trace("depth", plain) is plain
    assert lattice_to_trace("nearest", None) == Lattice(16, 1, displaced=False)
    refused(r"views: .*not displaced", lattice_to_trace, "nearest", Lattice(8))
    refused("views: displaced views need", lattice_to_store, False, Lattice(8))


def test_a_scene_of_arrays_is_that_of_the_same_file(model):
    mesh = trimesh.load(model, force="mesh")
    triangles = mesh.vertices[mesh.faces]
    default = lfcore.Surface(diffuse=(1, 1, 1), metallic=1.0)  # glTF's
    scene = lfcore.Scene.from_triangles(triangles, surface=default)
    known = lfcore.load_scene(model, bare=True)
    np.testing.assert_allclose(scene.triangles, known.triangles, atol=1e-6)
    assert scene.camera.focus_m == pytest.approx(known.camera.focus_m)
    ours, theirs = (lfcore.render(s, pixels=24, views=2) for s in (scene, known))
    assert np.abs(ours - theirs).mean() < 0.02


def test_triangles_before_a_camera_are_in_its_space():
    camera = lfcore.Camera(0.05, 0.036, 2.0, 3.0)
    wall = [[[-9, -9, 3], [9, -9, 3], [0, 9, 3]]]
    glow = lfcore.Surface("glow", diffuse=(0, 0, 0), emission=(0.25, 0.5, 1.0))
    scene = lfcore.Scene.from_triangles(wall, camera=camera, surface=glow, lights=[])
    assert scene.camera == camera
    picture = lfcore.render(scene, pixels=16, views=2)
    np.testing.assert_allclose(picture[8, 8], [0.25, 0.5, 1.0], atol=1e-5)


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"triangles": np.zeros((0, 3, 3))}, "triangles: the scene is empty"),
        ({"triangles": np.zeros((2, 3, 3))}, "triangles: the scene is empty.*zero area"),
        ({"triangles": np.zeros((2, 3))}, r"triangles: must be \(T, 3, 3\), not"),
        ({"triangles": "words"}, "triangles: are no array of numbers"),
        ({"triangles": np.eye(3)[None], "uvs": np.zeros((2, 3, 2))}, r"uvs: must be \(1, 3, 2\)"),
        ({"triangles": np.eye(3)[None], "normals": [[1]]}, "normals: must be"),
    ],
)
def test_arrays_that_make_no_scene(arrays, words):
    refused(words, lfcore.Scene.from_triangles, **arrays)


def test_a_camera_array(recorded):
    scene, _ = recorded
    array = lfcore.CameraArray.on_grid((3, 2), (-0.2, 0.2, -0.1, 0.1), 45.0, (16, 16))
    image = lfcore.trace_array(scene, array, 2)
    assert image.shape == (32, 48, 3) and image.max() > 0.1
    with pytest.raises(lfcore.OpticsError):
        lfcore.trace_array(scene)


def test_every_public_name_is_there_and_loads_alone():
    assert {"load_scene", "record", "LightField"} <= set(lfcore.__all__)
    for name in lfcore.__all__:
        assert getattr(lfcore, name).__doc__, name
    assert set(lfcore.__all__) <= set(dir(lfcore))
    program = "import sys, lfcore; print({'numpy', 'pyopencl', 'av', 'cv2'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout == "set()\n", done.stderr
    with pytest.raises(AttributeError, match="nothing"):
        _ = lfcore.nothing


def test_the_example_in_the_readme_runs(tmp_path, monkeypatch):
    readme = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    example = readme.split("```python\n")[1].split("```")[0]
    assert "pixels=512" in example
    monkeypatch.chdir(tmp_path)
    made: dict = {}
    exec(compile(example.replace("pixels=512", "pixels=32"), "README.md", "exec"), made)
    assert made["near"].shape == (32, 32, 3)
    assert (tmp_path / "near.png").is_file() and (tmp_path / "bike.mkv").is_file()


def test_focal_stacks_take_arrays(recorded):
    scene, field = recorded
    focus, stops = np.array([0.8, 1.2]) * scene.camera.focus_m, np.array([2.0, 4.0])
    made = field.stack(focus, stops, filter="nearest", pixels=16)
    same = field.stack(focus.tolist(), stops.tolist(), filter="nearest", pixels=16)
    assert made.shape == (4, 16, 16, 3)
    np.testing.assert_array_equal(made, same)
    assert field.stack(focus, fast=True).shape == (2, 32, 32, 3)
    for key, value in (("filter", "nonsense"), ("pixels", 16)):
        refused(f"{key}: a fast stack has its own", field.stack, focus, fast=True, **{key: value})


def test_numbers_of_numpy_are_numbers(recorded, tmp_path):
    scene, _ = recorded
    n, m = np.int64(3), np.int32(16)
    slab = lfcore.Slab(scene.camera, n, m)
    assert (slab.views, slab.pixels) == (3, 16) and type(slab.views) is int
    same = lfcore.render(scene, views=3, pixels=16)
    np.testing.assert_array_equal(lfcore.render(scene, views=n, pixels=m), same)
    assert lfcore.record(scene, tmp_path / "a.mkv", views=n, pixels=m).views_to_serve == 3


@pytest.mark.parametrize("wrong", [{"views": 0}, {"pixels": 0}, {"pixels": -4}, {"views": 2.5}])
def test_no_views_and_no_pixels_are_refused(recorded, tmp_path, wrong):
    scene, _ = recorded
    for make in (
        lambda: lfcore.render(scene, **wrong),
        lambda: lfcore.render(scene, filter="nearest", **wrong),
        lambda: lfcore.record(scene, tmp_path / "a.mkv", **wrong),
    ):
        refused(f"{next(iter(wrong))}: must be a whole", make)
    assert not list(tmp_path.iterdir())


def test_pictures_come_out_as_linear_light(recorded):
    _, field = recorded
    for read, where in (
        (field.view, (1, 2)), (field.macropixel, (16, 16)),
        (field.views, (0, 1, 2, 3)), (field.rectangle, (3, 4, 6, 9)),
    ):  # fmt: skip
        linear, codes = read(*where), read(*where, codes=True)
        assert (linear.dtype, codes.dtype) == (np.float32, np.uint8)
        assert np.abs(srgb_encode(linear) * 255 - codes).max() <= 0.51


def test_signatures_can_be_read():
    """An editor shows annotations as they are written, ``ArrayLike`` and not what it stands for."""
    for name in lfcore.__all__:
        public = getattr(lfcore, name)
        for call in (public, *(vars(public).values() if inspect.isclass(public) else ())):
            if callable(call):
                assert "_typing" not in str(inspect.signature(call)), (name, call)


def test_the_lens_is_in_the_signature_of_every_call_that_takes_it():
    """An editor shows the keywords, and unknown ones are refused by Python itself."""
    lens = {"focus_m", "focus_at", "blur"}
    for call in (
        lfcore.render, lfcore.render_to_quality, lfcore.record, lfcore.Scene.plane,
        lfcore.LightField.plane, lfcore.LightField.refocus, lfcore.LightField.stack,
    ):  # fmt: skip
        assert lens <= set(inspect.signature(call).parameters), call
    for name in lfcore.__all__:
        public = getattr(lfcore, name)
        calls = [public] if inspect.isfunction(public) else [
            call for each, call in vars(public).items()
            if inspect.isfunction(call) and not each.startswith("_")
        ]  # fmt: skip
        for call in calls:
            kinds = {each.kind for each in inspect.signature(call).parameters.values()}
            assert inspect.Parameter.VAR_KEYWORD not in kinds, call


def test_unknown_keywords_name_the_right_one():
    for call, name, typo, meant in (
        (lfcore.SensorPlane, "SensorPlane", "focus", "focus_m"),
        (lfcore.Encoding, "Encoding", "crv", "crf"),
        (lfcore.Quality, "Quality", "quality", "quality_db"),
    ):  # fmt: skip
        with pytest.raises(TypeError, match=rf"^{name}\(\).*'{typo}'.*{meant}"):
            call(**{typo: 2})


def test_a_size_is_a_side_or_a_width_and_a_height(tmp_path, capsys):
    assert Size.of(512) == Size.of("512") == (512, 512)
    assert Size.of((1920, 1080)) == Size.of("1920x1080") == Size(np.int64(1920), 1080)
    for wrong in (0, True, 1.5, "12x", "0x9", (1, 2, 3), (4, 70000), None):
        refused(r"pixels: must be .* or two such as 1920x1080", Size.of, wrong)
    with pytest.raises(SystemExit):
        main(["render", "scene.yaml", "-o", str(tmp_path / "a.png"), "--pixels", "9x"])
    assert "'9x' is no size. It must be a whole number" in capsys.readouterr().err


def test_values_of_another_kind_are_refused(recorded, model, tmp_path):
    scene, field = recorded
    for key, value in (
        ("scene", "model.glb"), ("scene", None), ("quality", 40), ("focus_m", [1.0, 2.0]),
        ("planes", lfcore.SensorPlane(2.0, 2.0)), ("planes", [2.0]), ("f_number", "f/2"),
        ("pixels", b"x"), ("pixels", (3,)), ("pixels", (1, 2, 3)), ("device", 0),
    ):  # fmt: skip
        assert refused("must be", lfcore.render, **({"scene": scene} | {key: value})).key == key
    odd = lfcore.Light(7, (0, 0, 1), (1, 1, 1))
    for key, call in {
        "lights[0]": lambda: lfcore.Scene.from_triangles(scene.triangles, lights=[odd]),
        "encoding": lambda: lfcore.record(scene, tmp_path / "a.mkv", encoding="libx265"),
        "quality": lambda: lfcore.record(scene, tmp_path / "a.mkv", quality=40),
        "light": lambda: lfcore.load_scene(model, light="soft"),
        "light_points": lambda: lfcore.load_scene(model, light_points=-1),
        "threads": lambda: lfcore.open_device(threads=1.5),
        "focus_m": lambda: field.refocus([1.0, 2.0]),
        "distance_m": lambda: field.disparity_of(0.0),
        "bits": lambda: lfcore.write_picture(tmp_path / "a.png", np.zeros((2, 2, 3)), bits=12),
    }.items():
        assert refused("must be|unknown", call).key == key
    for picture in (None, 0.5, np.zeros(3), np.zeros((2, 2, 4)), np.zeros((2, 2, 3), int)):
        for name in ("a.png", "a.exr", "a.pfm"):
            refused("picture", lfcore.write_picture, tmp_path / name, picture)
    assert not list(tmp_path.iterdir())
