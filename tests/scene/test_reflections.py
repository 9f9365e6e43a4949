"""Notes on reflections that pictures lack."""

import json

import pytest
import trimesh

from lfcore import load_scene
from lfcore.cli import main
from lfcore.scene.notes import LEFT_OUT

GOLD = {"diffuse": [1.0, 0.8, 0.3], "metallic": 1.0, "roughness": 0.4}
SMOOTH, SATIN = (GOLD | {"roughness": roughness} for roughness in (0.3, 0.9))
PLASTIC = GOLD | {"metallic": 0.0}
MATT, LACQUER = {"diffuse": [0.5, 0.5, 0.5]}, {"specular": [0.2, 0.2, 0.2], "shininess": 100}
LAMP = {"diffuse": [0.5, 0.5, 0.5], "emission": [5.0, 5.0, 5.0]}
METAL = "near metals (ball), which reflect sky and lights alone"
GLOSS = "of emitting surfaces (ball) in glossy ones (ball)"


@pytest.fixture
def described(tmp_path):
    """Writes a scene.yaml with a ball at the origin, and another one ``distance`` away."""

    def write(one, other, distance=1.0):
        trimesh.creation.icosphere(1, radius=0.4).export(tmp_path / "ball.ply")
        objects = [
            {"file": "ball.ply", "material": material, "transform": [{"translate_m": [x, 0, 0]}]}
            for x, material in ((0.0, one), (distance, other))
        ]
        text = json.dumps({"objects": objects})
        (tmp_path / "scene.yaml").write_text(text)
        return tmp_path / "scene.yaml"

    return write


@pytest.mark.parametrize(
    ("one", "other", "distance", "expected"),
    [
        (GOLD, MATT, 1.0, [METAL]), (GOLD, MATT, 9.0, []), (SATIN, MATT, 1.0, []),
        (SMOOTH, MATT, 1.0, []),
        (PLASTIC, MATT, 1.0, []), (PLASTIC, LAMP, 9.0, [GLOSS]), (LACQUER, LAMP, 9.0, [GLOSS]),
        (GOLD, LAMP, 1.0, [METAL, GLOSS]), (MATT, LAMP, 1.0, []), (LAMP | LACQUER, MATT, 1.0, []),
    ],
)  # fmt: skip
def test_reflections_of_other_surfaces_are_noted(described, one, other, distance, expected):
    file = described(one, other, distance)
    notes = load_scene(file).notes
    assert [(note.kind, note.file) for note in notes] == [(LEFT_OUT, file)] * len(expected)
    assert all(what in note.what for what, note in zip(expected, notes, strict=True))


@pytest.mark.parametrize("command", ["info", pytest.param("render", marks=pytest.mark.kernels)])
def test_commands_say_the_note_once(described, tmp_path, capsys, command):
    picture = ["-o", str(tmp_path / "a.png"), "--pixels", "16", "--views", "1"]
    main([command, str(described(GOLD, MATT)), *(picture if command == "render" else [])])
    out, err = capsys.readouterr()
    assert (out + err).count(METAL) == 1
