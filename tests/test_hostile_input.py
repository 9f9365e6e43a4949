"""Files of others start no program, and what they say reaches no terminal as it is."""

import io
import os
import subprocess

import numpy as np
import pytest
import trimesh
from PIL import EpsImagePlugin, Image
from plain_scenes import refused

import lfcore
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
    refused("", lfcore.import_lightfield, tmp_path / "views", tmp_path / "a.mkv")
    assert not ghostscript.exists()
