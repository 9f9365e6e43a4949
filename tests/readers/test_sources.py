"""The files that a scene is made from, and files of any content that are read within bounds."""

import base64
import gzip
import json
import os

import pytest
import trimesh
from plain_scenes import refused

from lfcore import reading
from lfcore.readers.load import load_scene
from lfcore.readers.sources import asks_for_light, files_of_scene


def names(path):
    return [file.relative_to(path.parent).as_posix() for file in files_of_scene(path)]


@pytest.fixture
def write(tmp_path):
    def write_files(**files):
        for name, text in files.items():
            path = tmp_path / name.replace("__", "/").replace("_", ".")
            path.parent.mkdir(exist_ok=True)
            path.write_text(text)
        return tmp_path

    return write_files


def test_meshes_and_textures_of_a_description(write):
    folder = write(
        scene_yaml=(
            "objects: [{file: a.obj, materials: {skin: {texture: skin.png}}},"
            " {builder: book, material: {texture: wood.png}}, {file: absent.ply}]"
        ),
        a_obj="mtllib own.mtl\nv 0 0 0",
        own_mtl="newmtl x\nmap_Kd -s 1 1 1 pic.jpg\n\tmap_bump my bump.png\n",
        pic_jpg="",
        skin_png="",
        wood_png="",
        other_png="",
    )
    (folder / "my bump.png").touch()
    found = ["scene.yaml", "a.obj", "my bump.png", "own.mtl", "pic.jpg", "skin.png", "wood.png"]
    assert names(folder / "scene.yaml") == found


def test_pbrt_includes_of_any_name_meshes_textures_and_spectra(write):
    folder = write(
        main_pbrt='Include "parts/geometry.inc"\nLightSource "infinite" "string mapname" "sky.exr"',
        parts__geometry_inc=(
            '  Import "more.pbrt" Shape "plymesh" "string filename" [ "parts/mesh.ply" ]\n'
            '"spectrum L" "lamp.spd" # Include "remark.pbrt"'
        ),
        parts__more_pbrt='"string filename" "wood.png" Include "main.pbrt"',
        parts__wood_png="",
        parts__mesh_ply="",
        sky_exr="",
        lamp_spd="",
        remark_pbrt="",
        unused_pbrt="",
    )
    assert set(names(folder / "main.pbrt")) == {
        "main.pbrt", "parts/geometry.inc", "parts/more.pbrt", "parts/wood.png", "parts/mesh.ply",
        "sky.exr", "lamp.spd", "remark.pbrt",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("light", "asks"),
    [
        ('"infinite" "rgb L" [1E0 1 1] # of all\n "string mapname" "sky.exr"', True),
        ('"infinite" "string filename" [ "sky.exr" ]', True),
        ('"infinite" "rgb L" [1 1 1]', True),
        ('"distant" # LightSource "infinite"', False),
        ('"distant" "string mapname" "sky.exr"', False),
    ],
)
def test_infinite_light_of_pbrt_is_baked(write, light, asks):
    folder = write(main_pbrt='Include "a.inc"', a_inc=f"LightSource {light}\nWorldEnd", sky_exr="")
    assert asks_for_light(folder / "main.pbrt") is asks


def test_a_packed_pbrt_scene_and_a_packed_mesh(write):
    folder = write()
    (folder / "main.pbrt.gz").write_bytes(gzip.compress(b'"string filename" "m.ply.gz"'))
    (folder / "m.ply.gz").touch()
    assert names(folder / "main.pbrt.gz") == ["main.pbrt.gz", "m.ply.gz"]


def test_files_of_gltf_and_ply(write):
    inline = "data:application/octet-stream;base64," + base64.b64encode(b"pic.png").decode()
    document = {
        "buffers": [{"uri": "b.bin"}, {"uri": inline}, {}],
        "images": [{"uri": "my%20pic.png"}],
    }
    folder = write(m_gltf=json.dumps(document), b_bin="")
    (folder / "my pic.png").touch()
    assert names(folder / "m.gltf") == ["m.gltf", "b.bin", "my pic.png"]
    folder = write(m_ply="ply\nformat ascii 1.0\ncomment TextureFile skin.png\n", skin_png="")
    assert names(folder / "m.ply") == ["m.ply", "skin.png"]
    (folder / "m.dae").write_text("<image><init_from> skin.png </init_from></image>")
    assert names(folder / "m.dae") == ["m.dae", "skin.png"]
    trimesh.creation.box().export(
        folder / "m.glb", tree_postprocessor=lambda tree: tree.update(images=[{"uri": "skin.png"}])
    )
    assert names(folder / "m.glb") == ["m.glb", "skin.png"]


ENTRIES = "objects: [7, {file: 8, materials: [1]}, {material: 3}]"


@pytest.mark.parametrize("text", ["objects: [", "7", ENTRIES, "a: &a [*a]", "\0"])
def test_what_cannot_be_parsed_is_itself_alone(write, text):
    folder = write(scene_yaml=text, broken_glb="glTF", broken_gltf="{", empty_obj="mtllib \n")
    for name in ("scene.yaml", "broken.glb", "broken.gltf", "empty.obj", "missing.pbrt"):
        assert names(folder / name) == [name]


def test_aliases_and_whole_floats_may_be_used(write_scene, tetrahedron):
    skin = "&skin {diffuse: [1, 0, 0]}"
    entry = f"file: {tetrahedron.name}, material:"
    path = write_scene(f"objects: [{{{entry} {skin}}}, {{{entry} *skin}}]")
    assert len(load_scene(path, bare=True).materials) == 1
    scene = load_scene(write_scene("objects: [{builder: sphere, seed: 1.0}]"), bare=True)
    other = load_scene(write_scene("objects: [{builder: sphere, seed: 1}]"), bare=True)
    assert (scene.textures[0] == other.textures[0]).all()


def test_files_that_are_too_large_or_no_text(tmp_path):
    path = tmp_path / "scene.yaml"
    with path.open("wb") as stream:
        stream.truncate(reading.LARGEST_DESCRIPTION + 1)
    refused("more than 4 MiB", load_scene, path)
    path.write_bytes(b"objects: \xff\xfe")
    refused("UTF-8", load_scene, path)


@pytest.mark.parametrize("name", ["scene.yaml", "scene.pbrt", "mesh.obj", "mesh.ply"])
def test_pipes_and_folders_are_refused(tmp_path, name):
    for make in (lambda path: None, *([os.mkfifo] if hasattr(os, "mkfifo") else [])):
        make(tmp_path / name)
        refused(r"device or pipe|not found", load_scene, tmp_path / name)
    (tmp_path / name).unlink(missing_ok=True)
    (tmp_path / name).mkdir()
    assert refused(None, reading.read_bytes, tmp_path / name, 10).remedy


ABC = gzip.compress(b"abc", mtime=0)


@pytest.mark.parametrize(
    "packed, words",
    [
        pytest.param(gzip.compress(b"x" * 600, mtime=0) * 2, "more than 1000 bytes", id="parts"),
        pytest.param(ABC[:5] + b"\xff" * 20, "cannot be unpacked", id="damaged"),
        pytest.param(ABC + b"tail", "cannot be unpacked", id="tail"),
        pytest.param(b"", "is empty", id="empty"),
    ],
)
def test_archives_that_are_damaged_or_grow(tmp_path, packed, words):
    path = tmp_path / "x.gz"
    path.write_bytes(packed)
    assert refused(words, reading.read_bytes, path, 1000).remedy
    path.write_bytes(ABC + gzip.compress(b"def") + b"\0" * 512)
    assert reading.read_bytes(path, 6) == b"abcdef"
