"""COLLADA: polygons of all kinds, materials, colours, unit and axis; what is left out is said."""

import io
import zipfile

import numpy as np
import pytest
from PIL import Image
from plain_scenes import load_mesh, refused

from lfcore.readers.load import load_scene
from lfcore.scene.notes import Notebook
from lfcore.scene.surface_mesh import area_vectors

NOTCHED = "0 0 0 4 0 0 4 4 0 2 1 0 0 4 0"
"""A square of 16 without the triangle (0, 4), (2, 1), (4, 4), of 6."""
FILE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="{unit}"/><up_axis>{axis}_UP</up_axis></asset>
<library_images><image id="i"><init_from>./t.png</init_from></image></library_images>
<library_effects><effect id="e"><profile_COMMON>
<newparam sid="surface"><surface><init_from>i</init_from></surface></newparam>
<newparam sid="sampler"><sampler2D><source>surface</source></sampler2D></newparam>
<technique sid="t"><lambert><diffuse>{diffuse}</diffuse></lambert></technique>
</profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="a">{points}</float_array><technique_common>
<accessor source="#a" count="5" stride="3"/></technique_common></source>
<source id="c"><float_array id="b">1 0 0 1 0 0 1 0 0 1 0 0 1 0 0</float_array><technique_common>
<accessor source="#b" count="5" stride="3"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
{faces}</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node>{place}<instance_geometry url="#g">
<bind_material><technique_common><instance_material symbol="shiny" target="#m"/></technique_common>
</bind_material></instance_geometry><instance_light url="#l"/></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>
"""
VERTEX = '<input semantic="VERTEX" source="#v" offset="0"/>'
COLOUR = '<input semantic="COLOR" source="#c" offset="0"/>'
UV = '<input semantic="TEXCOORD" source="#p" offset="0"/>'
LIST = f'<polylist material="shiny">{VERTEX}<vcount>5</vcount><p>0 1 2 3 4</p></polylist>'
RED, TEXTURE = "<color>1 0 0 1</color>", '<texture texture="sampler" texcoord="x"/>'


def read(path, **changes):
    """The only part of a file, and the words of its notes."""
    usual = {"unit": 1, "axis": "Y", "diffuse": RED, "points": NOTCHED, "faces": LIST, "place": ""}
    text = FILE.format(**usual | changes)
    if path.suffix == ".zae":
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("a/m.dae", text)
            picture = io.BytesIO()
            Image.new("RGB", (2, 2), (0, 255, 0)).save(picture, "png")
            archive.writestr("a/t.png", picture.getvalue())
    else:
        path.write_text(text)
    notebook = Notebook()
    (part,) = load_mesh(path, notebook=notebook)
    return part, {note.what for note in notebook.notes()}


@pytest.mark.parametrize(
    ("faces", "area"),
    [
        (LIST, 10.0),
        (f"<polygons>{VERTEX}<p>0 1 2 3 4</p></polygons>", 10.0),
        (f"<triangles>{VERTEX}<p>0 1 2</p></triangles>", 8.0),
        (f"<trifans>{VERTEX}<p>3 4 0 1 2</p></trifans>", 10.0),
        (f"<tristrips>{VERTEX}<p>0 1 4 2</p></tristrips>", 16.0),
    ],
)
def test_polygons_of_all_kinds_have_their_area(tmp_path, faces, area):
    part, notes = read(tmp_path / "m.dae", faces=faces)
    vectors = area_vectors(part.triangles)
    assert np.linalg.norm(vectors, axis=1).sum() / 2 == pytest.approx(area)
    assert (vectors[:, 2] > 0).all()
    # The only material holds, also for polygons that do not name it.
    assert part.surface.diffuse == (1, 0, 0)
    assert notes == {"lights"}


def test_texture_and_colours_of_vertices_count_together(tmp_path):
    faces = LIST.replace("<vcount>", COLOUR + UV + "<vcount>")
    part, notes = read(tmp_path / "m.zae", faces=faces, diffuse=TEXTURE)
    assert part.surface.texture[0, 0].tolist() == [0, 255, 0]
    np.testing.assert_array_equal(part.uvs, part.triangles[..., :2])
    assert np.unique(part.colours.reshape(-1, 3), axis=0).tolist() == [[1, 0, 0]]
    assert notes == {"lights"}
    part, notes = read(tmp_path / "m.dae", faces=faces, diffuse=TEXTURE)
    assert notes == {"lights", "texture './t.png', not found"}


def test_what_is_not_bound_is_noted(tmp_path):
    part, notes = read(tmp_path / "m.dae", faces=LIST.replace("shiny", "matt"))
    assert part.surface.diffuse == (0.8, 0.8, 0.8)
    assert any("'matt'" in note for note in notes)


@pytest.mark.parametrize(("axis", "last"), [("X", (-4, 0, 0)), ("Y", (0, 4, 0)), ("Z", (0, 0, -4))])
def test_a_file_has_its_unit_and_axis(tmp_path, axis, last):
    path = tmp_path / "m.dae"
    for unit in ("0.01", "0,01"):  # by programs of some countries
        part, _ = read(path, axis=axis, unit=unit)
        corners = part.triangles.reshape(-1, 3) * 100
        assert np.abs(corners - last).max(1).min() < 1e-9
    refused("says by itself", load_scene, path, up="z")
    refused("unit", read, path, unit="none")


def test_steps_of_a_node_are_applied_from_the_last(tmp_path):
    place = "<translate>1 0 0</translate><rotate>0 0 1 90</rotate><scale>2 1 1</scale>"
    part, _ = read(tmp_path / "m.dae", place=place)
    low, high = part.triangles.min((0, 1)), part.triangles.max((0, 1))
    np.testing.assert_allclose((low, high), [(-3, 0, 0), (1, 8, 0)], atol=1e-12)


@pytest.mark.parametrize(
    "changes",
    [
        {"faces": LIST.replace("3 4<", "3 7<")},
        {"faces": LIST.replace("<vcount>5", "<vcount>6")},
        {"faces": LIST.replace("#v", "#x")},
        {"points": "0 0 zero"},
        {"place": "<matrix>1 2 3</matrix>"},
        {"place": '<instance_node url="#s"/>'},
        {"faces": f"<lines>{VERTEX}<p>0 1</p></lines>"},
        {"faces": LIST.replace("</polylist>", "")},
    ],
)
def test_what_makes_no_sense_is_refused(tmp_path, changes):
    refused("m.dae", read, tmp_path / "m.dae", **changes)
