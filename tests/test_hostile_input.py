"""Files of others start no program, and what they say reaches no terminal as it is."""

import contextlib
import io
import os
import re
import subprocess
import unicodedata

import numpy as np
import pytest
import trimesh
import yaml
from PIL import EpsImagePlugin, Image
from plain_scenes import refused

import lfcore
from lfcore.cli import main
from lfcore.evaluation.page import Section, write_page
from lfcore.pictures import picture_size, read_picture

POSTSCRIPT = b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 8 8\n%%EndComments\nshowpage\n"
OBJ = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nusemtl a\nf 1/1 2/2 3/3\n"


@pytest.fixture
def ghostscript(tmp_path, monkeypatch):
    """A file that is there when Ghostscript has been started."""
    (tmp_path / "bin").mkdir()
    program, started = tmp_path / "bin" / "gs", tmp_path / "started"
    program.write_text(f"#!/bin/sh\ntouch {started}\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{program.parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setattr(EpsImagePlugin, "gs_binary", str(program))
    with pytest.raises(subprocess.CalledProcessError), Image.open(io.BytesIO(POSTSCRIPT)) as image:
        image.load()
    assert started.exists()
    started.unlink()
    return started


def test_a_picture_that_holds_postscript_starts_no_ghostscript(ghostscript, tmp_path):
    (tmp_path / "views").mkdir()
    for name in ("tex.png", "tex.eps", "tex.hdr", "views/0_0.png"):
        (tmp_path / name).write_bytes(POSTSCRIPT)
    refused("cannot be decoded", read_picture, tmp_path / "tex.png")
    refused("read as a picture", picture_size, tmp_path / "tex.png")
    for name in ("tex.png", "tex.eps"):
        (tmp_path / "m.mtl").write_text(f"newmtl a\nmap_Kd {name}\n")
        (tmp_path / "m.obj").write_text(OBJ)
        refused("cannot be decoded", lfcore.load_scene, tmp_path / "m.obj")
    quad = trimesh.load(io.StringIO(OBJ.replace("mtllib m.mtl\n", "")), file_type="obj")
    skin = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.new("RGB", (4, 4)))
    uv = np.array([[0.0, 0], [1, 0], [1, 1]])
    quad.visual = trimesh.visual.TextureVisuals(uv, material=skin)
    files = trimesh.exchange.gltf.export_gltf(trimesh.Scene(quad))
    (tmp_path / "gltf").mkdir()
    for name, data in files.items():
        if data.startswith(b"\x89PNG"):
            data = POSTSCRIPT.ljust(len(data))
        (tmp_path / "gltf" / name).write_bytes(data)
    assert any(data.startswith(b"\x89PNG") for data in files.values())
    refused("cannot be decoded", lfcore.load_scene, tmp_path / "gltf" / "model.gltf")
    ball = trimesh.creation.icosphere(0)
    ball.export(tmp_path / "ball.stl")
    sky = {"sky": {"file": str(tmp_path / "tex.hdr")}}
    refused("tex.hdr", lfcore.load_scene, tmp_path / "ball.stl", light=sky)
    (tmp_path / "views" / "0_1.png").write_bytes(POSTSCRIPT)
    grid = lfcore.ReadOptions(views=(2, 1))
    given = tmp_path / "views", tmp_path / "a.mkv"
    refused("picture", lfcore.import_lightfield, *given, format="folder", options=grid)
    assert not ghostscript.exists()


NAME = "a\x1b]0;b\x07\x1b[31m\u2028c\u202ed\nsize            1 byte"
"""A window's title, a colour, a line separator, a direction mark, and a line of our own."""


def harmless(text):
    """Whether it holds nothing that a terminal or browser would obey."""
    return not {"Cc", "Cf", "Cs", "Zl", "Zp"} & set(map(unicodedata.category, text.strip()))


@pytest.fixture(scope="module")
def named(tmp_path_factory):
    views = np.random.default_rng(1).random((3, 3, 16, 16, 3)).astype(np.float32)
    path = tmp_path_factory.mktemp("named") / "a.mkv"
    return lfcore.LightField.from_views(views, lfcore.Camera(0.05, 0.03, 2, 3), path, name=NAME)


def test_names_reach_no_terminal_as_they_are(named, tmp_path, capsys):
    mesh = tmp_path / f"{NAME.replace('/', '')}.obj"
    mesh.write_text(OBJ)  # it lacks its material library, of which a note tells
    scene = tmp_path / "scene.yaml"
    scene.write_text(yaml.safe_dump({"name": NAME, "objects": [{"file": mesh.name}]}))
    moved = tmp_path / f"{NAME}.mkv"
    moved.write_bytes(named.path.read_bytes())
    commands = (
        ["info", mesh], ["info", scene], ["info", moved], ["info", mesh, "--json"],
        ["export", moved, "--format", "json", "-o", tmp_path / NAME],
        ["render", f"{mesh}.ply", "-o", "a.png"], ["render", scene, "-o", "a.png", f"--{NAME}"],
    )  # fmt: skip
    for words in commands:
        with contextlib.suppress(SystemExit):
            main(list(map(str, words)))
        said = capsys.readouterr()
        lines = (said.out + said.err).split("\n")
        assert all(map(harmless, lines)), words
        assert "u202ed" in said.out + said.err, words
        assert not any(line.endswith(" 1 byte") and line.startswith("size") for line in lines)


def test_names_reach_no_page_as_they_are(named, tmp_path):
    assert harmless(re.search("<title>(.*?)</title>", named.viewer().html, re.DOTALL)[1])
    section = Section("a", NAME)
    write_page(tmp_path / "a.html", [section], title=NAME, introduction="", facts={NAME: NAME},
               config={})  # fmt: skip
    text = (tmp_path / "a.html").read_text()
    assert all(map(harmless, text.split("\n"))) and "u202ed" in text
