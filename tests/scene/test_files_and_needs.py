"""A scene on disk and what it needs."""

import dataclasses

import numpy as np
import pytest

from lfcore import Camera, Light, Material, Scene, SceneError
from lfcore.scene.appearance import DIRECTIONAL, POINT
from lfcore.scene.files import load_scene, read_header, save_scene
from lfcore.scene.needs import Needs


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
        material_ids=np.array([0, 1, 1, 0, 1], np.int32),
        materials=[Material("a"), Material("b", (1, 0, 0), (0.5,) * 3, 9.0, texture=0)],
        textures=[rng.integers(0, 255, (4, 6, 3), np.uint8)],
        lights=[
            Light(POINT, (0, 1, 2), (1, 0.5, 0.5), 2.0),
            Light(DIRECTIONAL, (0, -1, 0), (0.3,) * 3, casts_shadows=False),
        ],
        dropped={"zero area": 2},
        focus_distances_m=(1.0, 2.0),
    )


def same(a, b) -> bool:
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and np.array_equal(a, b)
    if isinstance(a, list) and a and isinstance(a[0], np.ndarray):
        return len(a) == len(b) and all(map(same, a, b))
    return a == b


def test_round_trip(tmp_path, scene):
    save_scene(tmp_path / "scene.npz", scene)
    loaded = load_scene(tmp_path / "scene.npz")
    for field in dataclasses.fields(Scene):
        assert same(getattr(scene, field.name), getattr(loaded, field.name)), field.name
    assert [path.name for path in tmp_path.iterdir()] == ["scene.npz"]


def test_equal_scenes_give_equal_bytes(tmp_path, scene):
    save_scene(tmp_path / "a.npz", scene)
    save_scene(tmp_path / "b.npz", scene)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_header_has_camera_and_needs(tmp_path, scene):
    save_scene(tmp_path / "scene.npz", scene)
    header = read_header(tmp_path / "scene.npz")
    assert header["name"] == "study" and header["triangles"] == 5
    assert header["needs"] == Needs.of(scene).to_json()


def test_array_of_the_wrong_shape_is_refused(tmp_path, scene):
    broken = dataclasses.replace(scene, uvs=scene.uvs[:3])
    save_scene(tmp_path / "scene.npz", broken)
    with pytest.raises(SceneError, match="uvs"):
        load_scene(tmp_path / "scene.npz")


def test_needs_of_everything(scene):
    assert Needs.of(scene) == Needs(
        textures=True, cut_outs=False, physical=False, smooth_normals=False, curved=False,
        vertex_colours=False,
        specular=True, emission=False, ambient=True, background=False, shadows=True, point_lights=1,
        directional_lights=1, falloff=True, coloured_lights=True, emitters=False, spots=False,
        baked=False, sky=False, stops=5,
    )  # fmt: skip


def test_needs_shrink_with_the_scene(scene):
    """Materials that no triangle has and lights that are black do not count."""
    bare = dataclasses.replace(
        scene,
        material_ids=np.zeros(5, np.int32),
        lights=[Light(POINT, (0, 0, 0), (0, 0, 0))],
        ambient=(0, 0, 0),
    )
    needs = Needs.of(bare)
    assert not any(dataclasses.astuple(needs)), needs
    assert not Needs.of(dataclasses.replace(scene, lights=[])).specular
