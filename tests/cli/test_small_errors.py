"""Errors that name what the user gave, and say what was meant."""

import io
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
import trimesh
from plain_scenes import CHART, refused

import lfcore
from lfcore.cli import COMMANDS, EPILOG, main


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    path = tmp_path_factory.mktemp("errors") / "a.mkv"
    return lfcore.record(lfcore.load_scene(CHART), path, pixels=16)


def all_commands():
    modules = {
        name: import_module(f"lfcore.cli.{module}") for name, (module, _) in COMMANDS.items()
    }
    return [module.COMMANDS[name] for name, module in modules.items()]


def said(capsys, *words):
    with pytest.raises(SystemExit) as ended:
        raise SystemExit(main(list(map(str, words))))
    assert ended.value.code
    return capsys.readouterr().err


def test_a_blur_that_the_lens_has_not_is_about_the_blur(recorded, capsys, tmp_path):
    line = said(capsys, "refocus", recorded.path, "--blur", "50%", "-o", tmp_path / "a.png")
    assert ": --blur: needs a lens of f/" in line
    most = line.partition("Give at most ")[2].partition("%")[0]
    recorded.plane(blur=f"{float(most) * 0.99}%")
    refused("blur: needs a lens", recorded.plane, blur=f"{float(most) * 1.01}%")


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        (["rendr", "a"], "Did you mean 'render'"),
        (["render", "a", "--pixel", "3", "-o", "a.png"], "Did you mean '--pixels'"),
        (["refocus", "a", "--metod=slicing", "-o", "a.png"], "Did you mean '--method'"),
        (["refocus", "a", "--filter", "depht", "-o", "a.png"], "Did you mean 'depth'"),
    ],
)
def test_misspelt_words_of_a_command(capsys, words, hint):
    line = said(capsys, *words)
    assert hint in line and line.count("\n") == 1


@pytest.mark.parametrize(
    ("call", "name", "meant"),
    [
        (lfcore.load_scene, "zom", "zoom"), (lfcore.render, "pixel", "pixels"),
        (lfcore.LightField.open, "salvag", "salvage"), (lfcore.Camera.from_matrix, "poze", "pose"),
        (lfcore.Scene.from_triangles, "normal", "normals"), (lfcore.Encoding, "codecs", "codec"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)  # fmt: skip
def test_misspelt_keywords_in_python(call, name, meant):
    with pytest.raises(TypeError, match=f"'{name}'. Did you mean '{meant}'"):
        call(**{name: 1})


def test_names_of_files_name_their_format(recorded, capsys, tmp_path):
    line = said(capsys, "render", CHART, "-o", "a.mkv")
    assert "a.mkv: --output: is the name of a light field, which record writes" in line
    (tmp_path / "a.fbx").write_bytes(b"Kaydara")
    assert "no reader for mesh files named *.fbx" in said(capsys, "info", tmp_path / "a.fbx")
    assert "none.mkv: " in said(capsys, "info", tmp_path / "none.mkv")
    other = tmp_path / "a.bin"
    other.write_bytes(recorded.path.read_bytes())
    assert main(["info", str(other)]) == 0  # whatever its name is
    scene, views = lfcore.load_scene(CHART), recorded.views(0, 0, 2, 2)
    for name in ("a.mp4", "a", "a.png"):
        refused("unknown format", lfcore.record, scene, tmp_path / name, pixels=8)
        refused("unknown format", lfcore.LightField.from_views, views, 0.01, tmp_path / name)
        refused("unknown format", lfcore.import_lightfield, tmp_path, tmp_path / name)


def test_values_of_another_kind_are_one_line(recorded):
    refused("focus_m: is empty", recorded.stack, [])
    assert len(recorded.stack(2.0)) == 1
    refused("fast: the views are displaced", recorded.stack, [2.0], fast=True)
    refused("crf: must be", lfcore.Encoding, crf="x")
    refused("subpixels: must be", lfcore.Lattice, 2, "2")
    assert lfcore.disparity(recorded.slab, recorded.slab.camera.focus_m) == 0
    by_default, said_aloud = recorded.refocus(2.0), recorded.refocus(2.0, method="slicing")
    assert (by_default == said_aloud).all()


def test_a_missing_texture_prints_no_traceback(tmp_path):
    """As fuze.ply of trimesh's models without its picture."""
    mesh = trimesh.load(io.StringIO("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), file_type="obj")
    head, body = mesh.export(file_type="ply", encoding="ascii").decode().split("\n", 1)
    _, _, rest = body.partition("\n")
    comment = "format ascii 1.0\ncomment TextureFile nowhere.png\n"
    (tmp_path / "a.ply").write_text(f"{head}\n{comment}{rest}")
    # A process of its own: pytest catches what is logged.
    command = [sys.executable, "-m", "lfcore", "info", str(tmp_path / "a.ply")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=100)
    assert "Traceback" not in done.stderr and done.stderr.count("\n") <= 1
    assert "nowhere.png" in done.stderr + done.stdout


def test_the_example_comes_with_the_package(tmp_path, monkeypatch, capsys):
    """Wherever one is; a file of that name goes first."""
    monkeypatch.chdir(tmp_path)
    assert main(["info", "example"]) == 0
    assert "10,000" in capsys.readouterr().out
    inside = Path(lfcore.__file__).parent
    assert lfcore.readers.load.EXAMPLE.is_relative_to(inside)
    (tmp_path / "example").mkdir()
    refused("example/scene.yaml", lfcore.load_scene, "example")
    for text in (EPILOG, *(one.examples for one in all_commands())):
        assert "scenes/" not in text  # the wheel has none
