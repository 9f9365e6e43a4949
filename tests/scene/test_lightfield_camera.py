"""The light field camera in scene.yaml and in pbrt's format: one meaning, kept on disk."""

import dataclasses

import numpy as np
import pytest

from lfcore.errors import SceneError
from lfcore.scene.build import build_scene
from lfcore.scene.files import load_scene, save_scene
from lfcore.scene.motion import scene_at
from lfcore.scene.pbrt import build_pbrt_scene

PBRT = """\
Scale -1 1 1
LookAt 1 2 6  0 0.5 0  0 1 0
Camera "lightfield" "float fov" [50] "integer camerasperdim" [4 2]
       "float cameragridbounds" [-0.5 0.5 -0.25 0.3] "float shutterclose" [0.5]
Film "image" "integer xresolution" [64] "integer yresolution" [32]
Sampler "stratified" "integer xsamples" [2] "integer ysamples" [3]
WorldBegin
LightSource "infinite" "rgb L" [1 1 1]
AttributeBegin
    Translate 0 1 0
    ActiveTransform EndTime  Translate 0.5 0 0  Rotate 30 0 0 1  ActiveTransform All
    Shape "trianglemesh" "integer indices" [0 1 2] "point P" [0 0 0  1 0 0  0 1 0]
AttributeEnd
WorldEnd
"""
CAMERA = {
    "pose": {"position_m": [1, 2, 6], "look_at_m": [0, 0.5, 0]},
    "lightfield": {
        "fov_deg": 50,
        "cameras_per_dim": [4, 2],
        "camera_grid_bounds_m": [-0.5, 0.5, -0.25, 0.3],
        "film_px": [64, 32],
        "samples_per_pixel": 6,
        "shutter": [0.0, 0.5],
    },
}
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
MOTION = [{"rotate": {"axis": "z", "angle_deg": 30}}, {"translate_m": [0.5, 0, 0]}]


@pytest.fixture
def pbrt(tmp_path):
    (tmp_path / "scene.pbrt").write_text(PBRT)
    return build_pbrt_scene(tmp_path / "scene.pbrt")


@pytest.fixture
def yaml_scene(tmp_path, write_scene):
    """A function that builds a scene.yaml of one triangle with this camera and motion."""
    (tmp_path / "triangle.obj").write_text(TRIANGLE)

    def build(camera=CAMERA, motion=MOTION):
        entry = {"file": "triangle.obj", "transform": [{"translate_m": [0, 1, 0]}]}
        return build_scene(write_scene({"camera": camera, "objects": [entry | {"motion": motion}]}))

    return build


def test_yaml_and_pbrt_mean_the_same(yaml_scene, pbrt):
    ours = yaml_scene()
    assert ours.view == pbrt.view
    assert ours.view.shutter == (0.0, 0.5) and ours.view.samples_per_pixel == 6
    assert ours.view.array.tile == (16, 16)
    assert len(ours.motions) == len(pbrt.motions) == 1
    for time in (0.0, 0.3, 1.0):
        a, b = (scene_at(scene, time).triangles for scene in (ours, pbrt))
        np.testing.assert_allclose(a, b, atol=1e-6)
    assert np.abs(scene_at(ours, 1.0).triangles - ours.triangles).max() > 0.3


@pytest.mark.parametrize(
    ("key", "value", "names"),
    [
        ("cameras_per_dim", [3, 2], "camera.lightfield.cameras_per_dim"),
        ("camera_grid_bounds_m", [0.5, -0.5, 0, 1], "camera.lightfield.camera_grid_bounds_m"),
        ("shutter", [1.0, 0.0], "camera.lightfield.shutter"),
        ("fov_deg", 180, "camera.lightfield.fov_deg"),
        ("spacing", "odd", "camera.lightfield.spacing"),
        ("fov", 50, "fov_deg"),
    ],
)
def test_mistakes_are_named(yaml_scene, key, value, names):
    changed = {**CAMERA, "lightfield": {**CAMERA["lightfield"], key: value}}
    with pytest.raises(SceneError, match=names.replace(".", r"\.")):
        yaml_scene(changed)


def test_motion_must_be_rigid(yaml_scene):
    with pytest.raises(SceneError, match=r"objects\[0\]\.motion"):
        yaml_scene(motion=[{"scale": 2.0}])


def test_the_scene_file_keeps_view_motions_and_notes(pbrt, tmp_path):
    save_scene(tmp_path / "scene.npz", pbrt)
    again = load_scene(tmp_path / "scene.npz")
    assert again.view == pbrt.view and again.notes == pbrt.notes and pbrt.notes
    assert again.summary() == pbrt.summary()
    for kept, motion in zip(again.motions, pbrt.motions, strict=True):
        for field in dataclasses.fields(motion):
            np.testing.assert_array_equal(getattr(kept, field.name), getattr(motion, field.name))
    a, b = (scene_at(scene, 0.7).triangles for scene in (again, pbrt))
    np.testing.assert_array_equal(a, b)
