"""A scene on disk, what it needs, and other programs'."""

import dataclasses
import importlib.util
import math
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from plain_scenes import CHART, refused

from lfcore import Camera, Light, Material, Motion, Scene, SensorPlane, open_device
from lfcore.colour import srgb_encode
from lfcore.evaluation.metrics import psnr
from lfcore.evaluation.renderers.comparison import spread_picture
from lfcore.evaluation.renderers.mitsuba import Description, render_mitsuba
from lfcore.evaluation.renderers.povray import render_povray, write_mesh, write_view
from lfcore.evaluation.renderers.rendered import or_left_out
from lfcore.readers.load import load_scene
from lfcore.rendering.prepared import open_tracer
from lfcore.scene.appearance import DIRECTIONAL, POINT
from lfcore.scene.baked import BakeOptions
from lfcore.scene.files import ARRAYS, read_header, read_scene, save_scene, scene_digest
from lfcore.scene.needs import Needs
from lfcore.scene.notes import Note
from lfcore.scene.transforms import rotate
from lfcore.scene.view import lightfield_view


@pytest.fixture
def scene():
    rng = np.random.default_rng(3)
    return Scene(
        name="study",
        camera=Camera(0.05, 0.036, 2.0, float("inf")),
        triangles=rng.normal(size=(5, 3, 3)).astype(np.float32),
        normals=np.zeros((0, 3, 3), np.float32),
        uvs=rng.random((5, 3, 2)).astype(np.float32),
        colours=np.zeros((0, 3, 3), np.float32),
        material_ids=np.array([0, 1, 1, 2, 1], np.int32),
        materials=[Material("a"), Material("b", (1, 0, 0), (0.5,) * 3, 9.0, texture=0)],
        textures=[rng.integers(0, 255, (4, 6, 3), np.uint8)],
        lights=[
            Light(POINT, (0, 1, 2), (1, 0.5, 0.5), 2.0),
            Light(DIRECTIONAL, (0, -1, 0), (0.3,) * 3, casts_shadows=False),
        ],
        dropped={"zero area": 2},
        focus_distances_m=(1.0, 2.0),
        floor=Material("floor"),
        bake=BakeOptions(2),
    )


def test_round_trip(tmp_path, scene):
    scene = dataclasses.replace(
        scene,
        view=dataclasses.replace(lightfield_view((64, 32), 50.0, (4, 2)), shutter=(0.0, 0.5)),
        motions=(Motion(0, 2, np.eye(4), rotate("z", 30)),),
        notes=(Note("left out", Path("main.pbrt"), 3, "fog"),),
    )
    save_scene(tmp_path / "scene.npz", scene)
    loaded = read_scene(tmp_path / "scene.npz")
    save_scene(tmp_path / "again.npz", loaded)
    np.testing.assert_equal(dataclasses.asdict(loaded), dataclasses.asdict(scene))
    for name in ARRAYS:
        assert getattr(loaded, name).dtype == getattr(scene, name).dtype
    assert loaded.depth_range == scene.depth_range and loaded.summary() == scene.summary()
    header = read_header(tmp_path / "scene.npz")
    assert header["name"] == "study" and header["triangles"] == 5
    assert (tmp_path / "scene.npz").read_bytes() == (tmp_path / "again.npz").read_bytes()
    assert len(list(tmp_path.iterdir())) == 2


def test_array_of_the_wrong_shape_is_refused(tmp_path, scene):
    save_scene(tmp_path / "scene.npz", scene)
    with np.load(tmp_path / "scene.npz") as whole:
        arrays = dict(whole)
    np.savez(tmp_path / "scene.npz", **{**arrays, "uvs": scene.uvs[:3]})
    refused("uvs", load_scene, tmp_path / "scene.npz")


def test_needs(scene):
    assert Needs.of(scene) == Needs(
        textures=True, alpha_tests=False, physical=False, smooth_normals=False, curved=False,
        vertex_colours=False, shadows=True, baked=False, sky=False, specular=False, rough=False,
        clear=False, stops=5,
    )  # fmt: skip
    # Materials that no triangle has and lights that are black do not count.
    dark = {"lights": [Light(POINT, (0, 0, 0), (0, 0, 0))], "ambient": (0, 0, 0)}
    needs = Needs.of(dataclasses.replace(scene, material_ids=np.zeros(5, np.int32), **dark))
    assert not any(dataclasses.astuple(needs)), needs


@pytest.mark.parametrize(
    ("specular", "changes"),
    [
        (True, {"metallic": 1.0, "roughness": 0.0}),
        (False, {"metallic": 1.0, "roughness": 0.4}),
        (True, {"transmission": 0.5, "roughness": 0.4}),
        (True, {"opacity": 0.5}),
        (True, {"clearcoat": 0.5}),
        (False, {"clearcoat": 0.5, "clearcoat_roughness": 0.4}),
        (True, {"metallic": 1.0, "metal_texture": 0}),
        (True, {"alpha_blend": True}),
    ],
)
def test_rays_that_go_on_are_needed_by_the_materials_in_use(scene, specular, changes):
    smooth = np.dstack([np.tile(np.uint8([90, 4, 255]), (2, 2, 1)), np.uint8([[0, 9], [0, 9]])])
    materials = [Material("a"), Material("b", texture=0, **changes)]
    shown = dataclasses.replace(scene, materials=materials, textures=[smooth])
    assert Needs.of(shown).specular == specular
    unused = dataclasses.replace(shown, material_ids=np.zeros(5, np.int32))
    assert not Needs.of(unused).specular


@pytest.fixture(scope="module")
def chart():
    return load_scene(CHART, bare=True)


def written(folder, scene):
    write_mesh(folder, scene)
    file = write_view(folder, scene, scene.camera, samples=50)
    return file.read_text() + (folder / "mesh.inc").read_text()


def test_the_mesh_and_lens_are_the_scene_s(chart, tmp_path):
    text = written(tmp_path, chart)
    block = re.search(r"vertex_vectors \{ (\d+),\n(.*?)\n\}", text, re.S)
    vertices = np.array(re.findall(r"<(.*?),(.*?),(.*?)>", block[2]), np.float64)
    assert int(block[1]) == len(vertices) == 3 * chart.triangle_count
    expected = chart.triangles.reshape(-1, 3) * [1, -1, 1]
    assert np.allclose(vertices, expected, rtol=1e-6, atol=1e-6)
    assert len(re.findall(r"^<\d+,\d+,\d+>,\d+", text, re.M)) == chart.triangle_count
    angle = float(re.search(r"angle ([\d.]+)", text)[1])
    assert math.tan(math.radians(angle / 2)) == pytest.approx(chart.camera.field_width / 2)
    assert f"focal_point <0,0,{chart.camera.focus_m}>" in text
    assert "blur_samples 50" in text


def test_lights_and_materials(chart, tmp_path):
    scene = dataclasses.replace(
        chart,
        materials=[Material("lamp", (0.5, 0.4, 0.2), (0.3, 0.3, 0.3), 50.0, (0.1, 0.2, 0.0))]
        * len(chart.materials),
        lights=[
            Light(DIRECTIONAL, (0, -1, 0), (1, 1, 1), casts_shadows=False),
            Light(POINT, (1, 2, 3), (1, 2, 3), reference_distance_m=2.0),
        ],
    )
    text = written(tmp_path, scene)
    assert re.search(r"light_source \{ <0,10000,0> rgb <1,1,1> parallel .* shadowless \}", text)
    found = re.search(r"<1,-2,3> rgb <(\S+),\S+,\S+> fade_power 2 fade_distance (\S+) \}", text)
    # At the reference distance the light is its colour: 2 / (1 + (d / f)^2) times what is written.
    assert float(found[1]) * 2 / (1 + (2.0 / float(found[2])) ** 2) == pytest.approx(1, rel=1e-5)
    assert "specular 0.3 roughness 0.02" in text
    assert "emission rgb <0.2,0.5,0>" in text


def test_textures_carry_the_diffuse_colour(chart, tmp_path):
    textures = [np.full((4, 4, 3), 255, np.uint8)]
    materials = [Material("half", (0.5, 1.0, 0.0), texture=0)] * len(chart.materials)
    half = dataclasses.replace(chart, textures=textures, materials=materials)
    assert "uv_mapping image_map" in written(tmp_path, half)
    assert np.asarray(Image.open(tmp_path / "0.png"))[0, 0].tolist() == [188, 255, 0]


def test_what_is_not_exported_is_refused(chart, tmp_path):
    coloured = dataclasses.replace(chart, colours=np.ones_like(chart.triangles))
    glowing = [Material("glow", (0, 0, 0), emission=(1, 0, 0))] * len(chart.materials)
    far = dataclasses.replace(chart.camera, focus_m=math.inf)
    facing = Light(POINT, (0, 0, 0), (1, 1, 1), normal=(0.0, 0.0, 1.0))
    panel = dataclasses.replace(chart, lights=[facing])
    moving = dataclasses.replace(chart, motions=(Motion(0, 2, np.eye(4), np.eye(4)),))
    for scene, words in ((coloured, "corners"), (moving, "motion"), (panel, "area lights")):
        refused(words, written, tmp_path, scene)
        refused(words, Description, None, scene)
    refused("emission", written, tmp_path, dataclasses.replace(chart, materials=glowing))
    refused("infinity", written, tmp_path, dataclasses.replace(chart, camera=far))
    lit = dataclasses.replace(chart, lights=[Light(POINT, (0, 0, 0), (1, 1, 1))])
    refused("ambient", Description, None, lit)


def test_mirrors_glass_coats_and_veils_are_exported_to_mitsuba(chart, tmp_path):
    def made(**changes):
        materials = [Material("m", (0.5, 0.5, 0.5), **changes)] * len(chart.materials)
        bare = {"textures": [], "uvs": np.zeros((0, 3, 2), np.float32)}
        return dataclasses.replace(chart, materials=materials, **bare)

    for changes, kinds in (
        ({"metallic": 1.0, "roughness": 0.0}, ["twosided", "conductor"]),
        ({"transmission": 1.0}, ["dielectric"]),
        ({"transmission": 1.0, "thin_walled": True}, ["thindielectric"]),
        ({"clearcoat": 1.0}, ["twosided", "plastic"]),
        ({"opacity": 0.3}, ["mask", "twosided", "diffuse"]),
    ):
        bsdf, found = Description(None, made(**changes)).bsdf(0), []
        while bsdf:
            found.append(bsdf["type"])
            bsdf = bsdf.get("inner")
        assert found == kinds
        refused("holes, metal|glass, coats", written, tmp_path, made(**changes))
    tinted = {"attenuation_distance_m": 1.0, "attenuation_colour": (0.5, 0.5, 0.5)}
    for changes in ({"transmission": 1.0, **tinted}, {"metallic": 0.5, "roughness": 0.0}):
        refused("not exported", Description, None, made(**changes))


@pytest.mark.parametrize(
    ("render", "installed"),
    [
        pytest.param(render_povray, shutil.which("povray"), id="povray"),
        pytest.param(render_mitsuba, importlib.util.find_spec("mitsuba"), id="mitsuba"),
    ],
)
def test_other_programs_see_the_same_picture(chart, render, installed):
    tracer = open_tracer(chart, open_device(threads=1))
    plane = SensorPlane(1.0, chart.camera.f_number)
    made = or_left_out("another", render, chart, plane, 48, 12)
    if not installed:
        assert made.picture is None and "not installed" in made.note
        pytest.skip(made.note)
    truth = spread_picture(tracer, plane, 48, 16, 4)
    ours, theirs = (255 * srgb_encode(np.clip(p, 0, 1)) for p in (made.picture, truth))
    # A lens twice or half as wide, or a picture half a pixel aside, is below 30 dB.
    assert psnr(ours, theirs, peak=255) > 33
    assert made.picture.mean() == pytest.approx(truth.mean(), rel=0.01)
    assert made.seconds > 0 and made.rays == 144


def test_a_scene_has_one_digest_by_any_path(tmp_path, monkeypatch):
    shutil.copy(CHART.parent / "sphere/moving.pbrt", tmp_path)
    monkeypatch.chdir(tmp_path)
    here, there = (load_scene(path) for path in ("moving.pbrt", tmp_path / "moving.pbrt"))
    assert here.notes != there.notes and scene_digest(here) == scene_digest(there)
