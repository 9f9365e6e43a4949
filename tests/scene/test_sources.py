"""Which files a scene is made from, before it is parsed."""

import base64
import gzip
import json

import pytest
import trimesh
from test_gltf import packed

from lfcore.scene.sources import asks_for_light, files_of_scene


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
        ('"infinite" "rgb L" [1 1 1]\nTexture "a" "color" "imagemap" "string filename" "b"', False),
        ('"distant" "string mapname" "sky.exr"', False),
    ],
)
def test_light_of_a_pbrt_map_is_baked(write, light, asks):
    folder = write(main_pbrt='Include "a.inc"', a_inc=f"LightSource {light}\nWorldEnd", sky_exr="")
    assert asks_for_light(folder / "main.pbrt") is asks


def test_a_packed_pbrt_scene_and_a_packed_mesh(write):
    folder = write()
    (folder / "main.pbrt.gz").write_bytes(gzip.compress(b'"string filename" "m.ply.gz"'))
    (folder / "m.ply.gz").touch()
    assert names(folder / "main.pbrt.gz") == ["main.pbrt.gz", "m.ply.gz"]


def test_buffers_and_images_of_gltf(write):
    inline = "data:application/octet-stream;base64," + base64.b64encode(b"pic.png").decode()
    document = {
        "buffers": [{"uri": "b.bin"}, {"uri": inline}, {}],
        "images": [{"uri": "my%20pic.png"}],
    }
    folder = write(m_gltf=json.dumps(document), b_bin="")
    (folder / "my pic.png").touch()
    assert names(folder / "m.gltf") == ["m.gltf", "b.bin", "my pic.png"]


def test_every_file_that_an_exporter_writes_is_found(tmp_path):
    box = trimesh.creation.box()
    for name, data in box.scene().export(file_type="gltf").items():
        (tmp_path / name).write_bytes(data)
    found = set(names(tmp_path / "model.gltf"))
    assert found == {path.name for path in tmp_path.iterdir()}


def test_images_beside_a_glb_and_textures_of_a_ply(write):
    folder = write(m_ply="ply\nformat ascii 1.0\ncomment TextureFile skin.png\n", skin_png="")
    assert names(folder / "m.ply") == ["m.ply", "skin.png"]
    (folder / "m.glb").write_bytes(packed({"images": [{"uri": "skin.png"}]}, b""))
    assert names(folder / "m.glb") == ["m.glb", "skin.png"]


@pytest.mark.parametrize(
    "text",
    [
        "objects: [",
        "7",
        "objects: [7, {file: 8, materials: [1]}, {material: 3}]",
        "a: &a [*a]",
        "\0",
    ],
)
def test_what_cannot_be_parsed_is_itself_alone(write, text):
    folder = write(scene_yaml=text, broken_glb="glTF", broken_gltf="{", empty_obj="mtllib \n")
    for name in ("scene.yaml", "broken.glb", "broken.gltf", "empty.obj", "missing.pbrt"):
        assert names(folder / name) == [name]
