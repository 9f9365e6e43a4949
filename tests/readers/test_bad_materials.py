"""Materials that cannot be: one line with file, key and remedy, in every format."""

import pytest
import yaml
from gltf_files import File
from test_obj import OBJ
from test_pbrt import FILM, HEAD, TRIANGLE

from lfcore import LfcoreError, load_scene

GLASS = {"transmission": {"transmissionFactor": 1}}


def gltf(folder, entry):
    file, extensions = File(), {f"KHR_materials_{name}": each for name, each in entry.items()}
    file.use(*extensions)
    file.node(file.primitive({"name": "m", "extensions": extensions}))
    return file.write(folder)


def pbrt(folder, entry):
    path = folder / "scene.pbrt"
    path.write_text(f"{HEAD}{FILM}WorldBegin\nMaterial {entry}\n{TRIANGLE}\nWorldEnd\n")
    return path


def obj(folder, entry):
    (folder / "o.mtl").write_text(f"newmtl m\nKd 1 1 1\n{entry}\n")
    (folder / "o.obj").write_text(OBJ)
    return folder / "o.obj"


def described(folder, entry):
    obj(folder, "")
    path = folder / "scene.yaml"
    path.write_text(
        yaml.safe_dump({"name": "a", "objects": [{"file": "o.obj", "material": entry}]})
    )
    return path


BAD = [
    (gltf, GLASS | {"ior": {"ior": 0.9}}, "ior"),
    (gltf, {"transmission": {"transmissionFactor": 1.5}}, "transmissionFactor"),
    (gltf, GLASS | {"volume": {"attenuationDistance": -1}}, "attenuationDistance"),
    (gltf, GLASS | {"volume": {"thicknessFactor": -1}}, "thicknessFactor"),
    (gltf, GLASS | {"volume": {"attenuationColor": [1, 2, 0]}}, "attenuationColor"),
    (gltf, {"clearcoat": {"clearcoatFactor": 2}}, "clearcoatFactor"),
    (gltf, {"clearcoat": {"clearcoatRoughnessFactor": -1}}, "clearcoatRoughnessFactor"),
    (pbrt, '"glass" "float eta" 0.5', '"eta"'),
    (pbrt, '"dielectric" "spectrum eta" [400 .5 700 .5]', '"eta"'),
    (pbrt, '"glass" "rgb Kt" [2 2 2]', '"Kt"'),
    (pbrt, '"mirror" "rgb Kr" [-1 .5 .5]', '"Kr"'),
    (pbrt, '"conductor" "rgb reflectance" [2 2 2]', '"reflectance"'),
    (pbrt, '"uber" "rgb opacity" [2 2 2]', '"opacity"'),
    (pbrt, '"uber" "rgb opacity" [-1 -1 -1]', '"opacity"'),
    (pbrt, '"uber" "rgb Kt" [-.5 -.5 -.5]', '"Kt"'),
    (pbrt, '"translucent" "rgb transmit" [2 2 2]', '"transmit"'),
    (obj, "d 1.5", "d"),
    (obj, "Tr -1", "Tr"),
    (obj, "d 0.5\nillum 6\nNi 0.5", "Ni"),
    (obj, "d 0.5\nillum 6\nTf 2 2 2", "Tf"),
    (obj, "Pc 2", "Pc"),
    (obj, "Pr -1", "Pr"),
    (described, {"ior": 0.5}, "ior"),
    (described, {"opacity": -1}, "opacity"),
    (described, {"transmission": 2}, "transmission"),
    (described, {"clearcoat": 2}, "clearcoat"),
    (described, {"attenuation_distance_m": -1}, "attenuation_distance_m"),
    (described, {"attenuation_colour": [2, 0, 0]}, "attenuation_colour"),
]


@pytest.mark.parametrize(("write", "entry", "key"), BAD, ids=[key for *_, key in BAD])
def test_a_material_that_cannot_be_is_refused(tmp_path, write, entry, key):
    path = write(tmp_path, entry)
    with pytest.raises(LfcoreError) as caught:
        load_scene(path)
    error = caught.value
    assert key in str(error) and error.file.parent == tmp_path and error.remedy
    assert "\n" not in str(error)


@pytest.mark.parametrize(
    ("entry", "words"),
    [(GLASS | {"volume": {"attenuationDistance": 0, "thicknessFactor": 1}}, "of 0 as none"),
     (GLASS | {"ior": {"ior": 0}}, "as 1.5")],
)  # fmt: skip
def test_what_exporters_write_for_none_is_a_note(tmp_path, entry, words):
    scene = load_scene(gltf(tmp_path, entry), bare=True)
    assert words in scene.summary() and scene.materials[0].absorption == (0, 0, 0)


@pytest.mark.parametrize("key", ["metallicFactor", "roughnessFactor"])
def test_shares_beyond_one_are_cut_off_with_a_note(tmp_path, key):
    file = File()
    file.node(file.primitive({"name": "m", "pbrMetallicRoughness": {key: 1.5}}))
    scene = load_scene(file.write(tmp_path), bare=True)
    assert f"{key} 1.5" in scene.summary()
