"""Hostile files: whatever they hold, reading ends, soon and with one line.

More are in robustness/corpus.
"""

import gzip
import os

import pytest

from lfcore.errors import SceneError
from lfcore.scene import reading
from lfcore.scene.build import build_scene

LAUGHS = "a0: &a0 [1, 1]\n" + "".join(
    f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]\n" for k in range(1, 12)
)
HOSTILE_YAML = {
    "empty": ("", "mapping"),
    "a list": ("- a\n- b\n", "mapping"),
    "not closed": ("objects: [", "YAML"),
    "a tabulator": ("\tx: 1", "YAML"),
    "aliases of aliases": (LAUGHS, "aliases"),
    "contains itself": ("objects: &a [*a]\n", "contains itself"),
    "lists 3000 deep": ("objects: " + "[" * 3000 + "]" * 3000, "deep"),
    "a date that is none": ("objects: 2026-99-99\n", "YAML"),
    "a python object": ("objects: !!python/object:os.system []\n", "YAML"),
    "NUL": ("objects: \0\n", "YAML"),
    "an integer of 80 bits": ("ambient: [1, 1, 9999999999999999999999]", "bits"),
    "a false key": ("false: 2\nobjects: [{file: a}]\n", "unknown key"),
}  # fmt: skip


@pytest.mark.parametrize("text, words", HOSTILE_YAML.values(), ids=HOSTILE_YAML.keys())
def test_hostile_yaml_is_one_line(write_scene, text, words):
    path = write_scene(text)
    with pytest.raises(SceneError) as caught:
        build_scene(path)
    assert caught.value.file == path and caught.value.remedy
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_aliases_may_be_used(write_scene, tetrahedron):
    skin = "&skin {diffuse: [1, 0, 0]}"
    entry = f"file: {tetrahedron.name}, material:"
    path = write_scene(f"objects: [{{{entry} {skin}}}, {{{entry} *skin}}]")
    assert len(build_scene(path).materials) == 1


def test_whole_floats_count_as_integers(write_scene):
    scene = build_scene(write_scene("objects: [{builder: sphere, seed: 1.0}]"))
    other = build_scene(write_scene("objects: [{builder: sphere, seed: 1}]"))
    assert (scene.textures[0] == other.textures[0]).all()


def test_a_large_file_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "scene.yaml"
    with path.open("wb") as stream:
        stream.truncate(reading.LARGEST_DESCRIPTION + 1)
    with pytest.raises(SceneError, match="more than 4 MiB"):
        build_scene(path)


def test_bytes_that_are_no_text(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_bytes(b"objects: \xff\xfe")
    with pytest.raises(SceneError, match="UTF-8"):
        build_scene(path)


@pytest.mark.parametrize("name", ["scene.yaml", "scene.pbrt", "mesh.obj", "mesh.ply"])
def test_pipes_and_folders_are_refused(tmp_path, name):
    for make in (lambda path: None, *([os.mkfifo] if hasattr(os, "mkfifo") else [])):
        make(tmp_path / name)
        with pytest.raises(SceneError, match=r"device or pipe|not found"):
            build_scene(tmp_path / name)
    (tmp_path / name).unlink(missing_ok=True)
    (tmp_path / name).mkdir()
    with pytest.raises(SceneError) as caught:
        reading.read_bytes(tmp_path / name, 10)
    assert caught.value.remedy


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
    with pytest.raises(SceneError, match=words) as caught:
        reading.read_bytes(path, 1000)
    assert caught.value.remedy


def test_sound_archives(tmp_path):
    path = tmp_path / "x.gz"
    path.write_bytes(ABC + gzip.compress(b"def") + b"\0" * 512)
    assert reading.read_bytes(path, 6) == b"abcdef"
