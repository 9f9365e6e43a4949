"""3MF: unit, upward axis, components, colours, and what is not read."""

import zipfile

import numpy as np
import pytest
from plain_scenes import load_mesh, refused

from lfcore.scene.notes import Notebook

MODEL = """<?xml version="1.0"?>
<model unit="inch" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
xmlns:m="http://schemas.microsoft.com/3dmanufacturing/material/2015/02"><resources>
<basematerials id="5"><base name="red" displaycolor="#FF0000"/></basematerials>
<m:colorgroup id="6"><m:color color="#00FF00"/><m:color color="#0000FF80"/></m:colorgroup>
<object id="1"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>
<vertex x="0" y="2" z="3"/></vertices><triangles><triangle v1="0" v2="1" v3="2"/></triangles>
</mesh></object></resources><build><item objectid="1"/></build></model>
"""


@pytest.fixture
def read(tmp_path):
    def read(**models):
        path = tmp_path / "m.3mf"
        with zipfile.ZipFile(path, "w") as archive:
            for name, text in models.items():
                archive.writestr(f"3D/{name}.model", text)
        notebook = Notebook()
        return load_mesh(path, notebook=notebook), {note.what for note in notebook.notes()}

    return read


@pytest.mark.parametrize(("unit", "metres"), [("inch", 0.0254), ("millimeter", 0.001)])
def test_3mf_has_its_unit_and_z_up(read, unit, metres):
    (part,), notes = read(a=MODEL.replace("inch", unit))
    np.testing.assert_allclose(part.triangles[0, 2], np.array([0, 3, -2]) * metres, atol=1e-12)
    assert not notes
    refused("unit 'yard'", read, a=MODEL.replace("inch", "yard"))


def test_components_are_placed_by_their_transforms_also_from_another_model(read):
    turned = 'transform="0 1 0 -1 0 0 0 0 1 5 0 0"'  # x becomes y, and 5 along x
    parts = f'<component objectid="1" {turned} p:path="/3D/b.model"/><component objectid="8"/>'
    root = MODEL.replace('xmlns:m=', 'xmlns:p="http://p" xmlns:m=').replace(
        '<object id="1">', f'<object id="2"><components>{parts}</components></object>'
        '<object id="1">').replace('item objectid="1"', 'item objectid="2"')  # fmt: skip
    (part,), notes = read(a=root, b=MODEL.partition("<build>")[0] + "</model>")
    np.testing.assert_allclose(
        part.triangles[0] / 0.0254, [[5, 0, 0], [5, 0, -1], [3, 3, 0]], atol=1e-9
    )
    assert notes == {"object '8', which is not in the file"}


@pytest.mark.parametrize(
    ("picked", "linear"),
    [
        ('pid="5" p1="0"', [[1, 0, 0]] * 3),
        ('pid="6" p1="0" p2="1" p3="1"', [[0, 1, 0], [0, 0, 1], [0, 0, 1]]),
        ('pid="9" p1="0"', None),
    ],
)
def test_colours_are_of_triangles_and_corners(read, picked, linear):
    (part,), _ = read(a=MODEL.replace("<triangle v1", f"<triangle {picked} v1"))
    if linear is None:
        assert part.colours is None and part.surface.diffuse == (0.8, 0.8, 0.8)
    else:
        np.testing.assert_allclose(part.colours[0], linear, atol=1e-6)
        assert part.surface.diffuse == (1, 1, 1)


def test_damage_and_unread_elements_are_named(read):
    _, notes = read(a=MODEL.replace("<m:colorgroup", "<m:texture2dgroup/><m:colorgroup"))
    assert notes == {"groups of textures"}
    faces = MODEL.replace('<triangle v1="0" v2="1" v3="2"/>', "<beamlattice/>")
    refused("no triangles", read, a=faces)
    refused("vertex 7 of 3", read, a=MODEL.replace('v3="2"', 'v3="7"'))
    refused("round in circles", read, a=MODEL.replace("<mesh>", '<components><component'
            ' objectid="1"/></components><mesh>'))  # fmt: skip
    refused("XML is damaged", read, a=MODEL[:90])
    refused("builds no object", read, a=MODEL.replace("item objectid", "other objectid"))


def test_a_format_that_cannot_be_read_names_a_way(tmp_path):
    (tmp_path / "m.3ds").write_text("")
    refused(r"m\.3ds: no reader.*Blender", load_mesh, tmp_path / "m.3ds")
