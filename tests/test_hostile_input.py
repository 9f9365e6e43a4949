"""Files of others start no program, and what they say reaches no terminal as it is."""

import contextlib
import io
import json
import os
import re
import signal
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


def import_(path):
    """What imports a file, or the folder that it is in."""
    source = path.parent if path.parent.name == "views" else path
    lfcore.import_lightfield(source, path.with_name("out.mkv"))


@contextlib.contextmanager
def in_time():
    """Interrupts what waits for ever."""
    signal.signal(signal.SIGALRM, lambda *_: pytest.fail("it was read for ever"))
    signal.alarm(20)
    try:
        yield
    finally:
        signal.alarm(0)


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


def meshes_that_name(what):
    """Descriptions and meshes, by their names, that name another file."""
    gltf = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"uri": what, "byteLength": 36}],
    }  # fmt: skip
    objects = {"objects": [{"file": "plain.obj", "material": {"texture": what}}]}
    return {
        "buffer.gltf": json.dumps(gltf),
        "mesh.yaml": yaml.safe_dump({"objects": [{"file": what}]}),
        "texture.yaml": yaml.safe_dump(objects),
        "sky.yaml": yaml.safe_dump({"objects": [{"file": "plain.obj"}], "sky": {"file": what}}),
        "texture.pbrt": f'WorldBegin\nTexture "a" "spectrum" "imagemap" "string filename" "{what}"',
        "mesh.pbrt": f'WorldBegin\nShape "plymesh" "string filename" "{what}"',
        "include.pbrt": f'Include "{what}"',
    }


@pytest.fixture(params=["/dev/zero", "pipe.ply", "pipe.png", "pipe.hdr", "pipe.bin"])
def endless(request, tmp_path):
    """A device, or a pipe that nobody writes to."""
    (tmp_path / "plain.obj").write_text(OBJ.replace("mtllib m.mtl\n", ""))
    if request.param.startswith("pipe"):
        os.mkfifo(tmp_path / request.param)
    return tmp_path, request.param


def test_devices_and_pipes_that_a_scene_names_are_refused(endless):
    folder, what = endless
    for name, text in meshes_that_name(what).items():
        (folder / name).write_text(text)
        with in_time():
            refused("device|not found|no reader|Check the path", lfcore.load_scene, folder / name)


def test_a_material_library_or_texture_that_is_a_device_or_pipe_is_said(endless):
    folder, what = endless
    (folder / "m.mtl").write_text(f"newmtl a\nmap_Kd {what}\n")
    for text in (OBJ, OBJ.replace("m.mtl", what)):
        (folder / "m.obj").write_text(text)
        with in_time():
            try:
                said = lfcore.load_scene(folder / "m.obj", bare=True).summary()
            except lfcore.SceneError as error:
                said = str(error)
        assert what in said


@pytest.mark.parametrize(
    ("name", "read"),
    [
        ("a.mkv", lfcore.LightField.open), ("a.exr", lfcore.read_exr), ("a.png", read_picture),
        ("a.png", picture_size), ("a.obj", lfcore.load_scene), ("a.npz", lfcore.load_scene),
        ("a.yaml", lfcore.load_scene), ("a.glb", lfcore.load_scene), ("a.ply", lfcore.load_scene),
        ("a.npz", lfcore.BakedLight.load), ("a.h5", import_), ("a.mat", import_),
        ("views/scene.h5", import_), ("views/transforms.json", import_),
        ("views/param.txt", import_), ("views/0_0.png", import_),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)  # fmt: skip
def test_pipes_are_read_by_nobody(tmp_path, name, read):
    (tmp_path / "views").mkdir()
    os.mkfifo(tmp_path / name)
    with in_time():
        refused("pipe|not found|no such|known format", read, tmp_path / name)


def test_a_file_that_is_too_large_is_not_read(tmp_path, monkeypatch):
    monkeypatch.setattr(lfcore.pictures, "LARGEST_PICTURE", 1000)
    lfcore.write_picture(tmp_path / "a.png", np.random.default_rng(1).random((32, 32, 3)))
    refused("holds more than 1000 bytes", read_picture, tmp_path / "a.png")
