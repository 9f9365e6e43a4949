"""COLLADA and 3MF: unit, upward axis, and what is not read; or the package that is missing."""

import zipfile

import numpy as np
import pytest
import trimesh
from plain_scenes import load_mesh, refused

from lfcore.readers.load import load_scene
from lfcore.scene.notes import Notebook

DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="{unit}"/><up_axis>{axis}_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a" count="9">0 0 0 1 0 0 0 2 3</float_array><technique_common>
<accessor source="#a" count="3" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/>
<instance_light url="#l"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>
"""
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


@pytest.mark.parametrize(("axis", "last"), [("X", (-2, 0, 3)), ("Y", (0, 2, 3)), ("Z", (0, 3, -2))])
def test_collada_has_its_unit_and_axis(tmp_path, axis, last):
    pytest.importorskip("collada")
    path = tmp_path / "m.dae"
    path.write_text(DAE.format(unit=0.01, axis=axis))
    corners, notes = read(path)
    np.testing.assert_allclose(corners[2], np.array(last) / 100, atol=1e-12)
    assert notes == {"lights"}
    refused("says by itself", load_scene, path, up="z")
    path.write_text(DAE.format(unit="none", axis=axis))
    refused("unit", load_mesh, path)


@pytest.mark.parametrize(("unit", "metres"), [("inch", 0.0254), ("millimeter", 0.001)])
def test_3mf_has_its_unit_and_z_up(tmp_path, unit, metres):
    pytest.importorskip("lxml")
    path = tmp_path / "m.3mf"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("3D/3dmodel.model", MODEL.format(unit=unit))
    corners, notes = read(path)
    np.testing.assert_allclose(corners[2], np.array([0, 3, -2]) * metres, atol=1e-12)
    assert notes == {"groups of materials", "id 7 included but not defined!"}


def test_a_format_that_cannot_be_read_names_its_package_or_a_way(tmp_path, monkeypatch):
    monkeypatch.setattr(trimesh, "available_formats", lambda: {"obj"})
    for name, words in (("m.dae", "pycollada"), ("m.3mf", "lxml"), ("m.3ds", "Blender")):
        (tmp_path / name).write_text(DAE)
        refused(rf"{name}: no reader.*{words}", load_mesh, tmp_path / name)
