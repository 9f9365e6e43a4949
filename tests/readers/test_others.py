"""3MF: unit, upward axis, and what is not read; or the package that is missing."""

import zipfile

import numpy as np
import pytest
import trimesh
from plain_scenes import load_mesh, refused

from lfcore.scene.notes import Notebook

MODEL = """<?xml version="1.0"?>
<model unit="{unit}" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>
<basematerials id="5"><base name="red" displaycolor="#FF0000"/></basematerials>
<object id="1"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>
<vertex x="0" y="2" z="3"/></vertices><triangles><triangle v1="0" v2="1" v3="2"/></triangles>
</mesh></object></resources><build><item objectid="1"/><item objectid="7"/></build></model>
"""


def read(path):
    notebook = Notebook()
    (part,) = load_mesh(path, notebook=notebook)
    return part.triangles[0], {note.what for note in notebook.notes()}


@pytest.mark.parametrize(("unit", "metres"), [("inch", 0.0254), ("millimeter", 0.001)])
def test_3mf_has_its_unit_and_z_up(tmp_path, unit, metres):
    pytest.importorskip("lxml")
    path = tmp_path / "m.3mf"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("3D/3dmodel.model", MODEL.format(unit=unit))
    corners, notes = read(path)
    np.testing.assert_allclose(corners[2], np.array([0, 3, -2]) * metres, atol=1e-12)
    assert notes == {"groups of materials", "id 7 included but not defined!"}


def test_without_triangles_a_3mf_says_what_it_has(tmp_path):
    pytest.importorskip("lxml")
    path = tmp_path / "m.3mf"
    with zipfile.ZipFile(path, "w") as archive:
        faces = '<triangles><triangle v1="0" v2="1" v3="2"/></triangles>'
        model = MODEL.format(unit="inch").replace(faces, "<triangles/><beamlattice/>")
        archive.writestr("3D/3dmodel.model", model)
    refused("no triangles.*lattices", load_mesh, path)


def test_a_format_that_cannot_be_read_names_its_package_or_a_way(tmp_path, monkeypatch):
    monkeypatch.setattr(trimesh, "available_formats", lambda: {"obj"})
    for name, words in (("m.3mf", "lxml"), ("m.3ds", "Blender")):
        (tmp_path / name).write_text("")
        refused(rf"{name}: no reader.*{words}", load_mesh, tmp_path / name)
