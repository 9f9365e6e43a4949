"""Focus, blur and view in words on the command line, and the distances that commands report."""

import argparse
import json

import numpy as np
import pytest
import trimesh

from lfcore.api import load_scene, render
from lfcore.cli import main, values


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    """A large model: a ball of 800 m with a smaller one before it."""
    far = trimesh.creation.icosphere(3)
    near = trimesh.creation.icosphere(3, radius=0.4).apply_translation((-0.8, 0.3, 2.0))
    path = tmp_path_factory.mktemp("meshes") / "balls.ply"
    trimesh.util.concatenate([far, near]).apply_scale(800).export(path)
    return path


def made(command, mesh, out, *options):
    assert main([command, str(mesh), "-o", str(out), "--pixels", "32", *options]) == 0
    return np.load(out) if out.suffix == ".npy" else out


def test_words_give_the_pictures_of_the_library(mesh, tmp_path):
    scene = load_scene(mesh)
    for options, settings in (
        (["--focus", "near"], {"focus_m": "near"}),
        (["--focus", "40%", "--blur", "3%"], {"focus_m": "40%", "blur": 0.03}),
        (["--focus-at", "0.5,0.5"], {"focus_at": (0.5, 0.5)}),
        (["--plane", "focus=far,blur=3%"], {"focus_m": "far", "blur": 0.03}),
    ):
        found = made("render", mesh, tmp_path / "a.npy", *options)
        np.testing.assert_array_equal(found, render(scene, pixels=32, **settings))


def test_a_view_from_a_side_and_closer(mesh, tmp_path):
    found = made("render", mesh, tmp_path / "a.npy", "--from", "right", "--zoom", "1.5")
    scene = load_scene(mesh, view_from="right", zoom=1.5)
    np.testing.assert_array_equal(found, render(scene, pixels=32))
    assert np.abs(found - render(load_scene(mesh), pixels=32)).max() > 0.1


def test_distances_are_reported(mesh, tmp_path, capsys):
    scene = load_scene(mesh)
    near, far = scene.depth_range
    made("render", mesh, tmp_path / "a.png", "--focus", "near")
    assert (
        f"near {near:.4g} m" in (said := capsys.readouterr().err) and f"focus {near:.4g} m" in said
    )
    made("render", mesh, tmp_path / "a.png", "--focus", "near", "--json")
    found = json.loads(capsys.readouterr().out)
    assert (found["near_m"], found["far_m"]) == (near, far)
    assert found["planes"][0]["focus_m"] == near
    assert main(["info", str(mesh)]) == 0
    assert f"near {near:.4g} m" in capsys.readouterr().out
    assert main(["info", str(mesh), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["far_m"] == far


def test_a_pinhole_is_not_recorded_without_a_word(tmp_path, capsys):
    path = tmp_path / "hole.pbrt"
    path.write_text(
        'Camera "perspective" "float fov" [40]\nWorldBegin\n'
        'Shape "trianglemesh" "integer indices" [0 1 2] "point P" [-3 -2 9  1 -2 8  -1 3 7]\n'
    )
    made("record", path, tmp_path / "a.mkv")
    assert "is a pinhole" in capsys.readouterr().err
    made("record", path, tmp_path / "b.mkv", "--blur", "3%", "--focus", "middle")
    assert "is a pinhole" not in capsys.readouterr().err
    made("plenoptic", path, tmp_path / "a.png", "--views", "4")
    assert "is a pinhole" in capsys.readouterr().err
    export = ["export", str(tmp_path / "a.mkv"), "--format", "hci", "--scene", str(path)]
    assert main([*export, "-o", str(tmp_path / "hci")]) == 0


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--from", "below"], "front"),
        (["--focus", "0.5"], "near or far"),
        (["--focus-at", "0.01,0.01"], "--focus-at: there is nothing"),
    ],
)
def test_what_this_model_has_not_is_one_line(mesh, tmp_path, capsys, options, said):
    out = tmp_path / "a.png"
    assert main(["render", str(mesh), "-o", str(out), *options]) == 1
    assert said in capsys.readouterr().err.splitlines()[-1] and not out.exists()


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("#ffffff", {"sky": {"colour": "#ffffff"}}),
        (",bounces=2", {"bounces": 2}),
        (
            "#0f0f0f,strength=2,bounces=0",
            {"sky": {"colour": "#0f0f0f", "strength": 2}, "bounces": 0},
        ),
    ],
)
def test_a_sky_on_the_command_line(text, found):
    assert values.sky(text) == found


@pytest.mark.parametrize("text", ["#ffffff,bounce=1", ",bounces=-1", ",strength=2"])
def test_a_sky_that_cannot_be(text):
    with pytest.raises(argparse.ArgumentTypeError):
        values.sky(text)
