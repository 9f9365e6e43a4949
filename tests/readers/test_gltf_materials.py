"""glTF's materials: factors, defaults, texture sets, glass and coats."""

import math

import numpy as np
import pytest
from gltf_files import UVS, File
from plain_scenes import refused

from lfcore.readers.load import load_scene
from lfcore.scene.files import read_scene, save_scene
from lfcore.scene.needs import Needs


@pytest.fixture
def scene_of(tmp_path):
    """A function: the scene of a square with a material; ``attributes`` are a texture's name."""

    def read(material, file=None, names=(), **attributes):
        file = file or File()
        file.use(*names)
        file.node(file.primitive(material, **attributes))
        return load_scene(file.write(tmp_path), bare=True)

    return read


def test_factors_are_what_the_file_says_and_defaults_the_specification_s(scene_of):
    given = {"baseColorFactor": [0.003, 0.5, 1 / 3, 1], "roughnessFactor": 0.123}
    material = scene_of({"pbrMetallicRoughness": given, "emissiveFactor": [0.0007, 0, 0]})
    (material,) = material.materials
    assert material.diffuse == (0.003, 0.5, 1 / 3) and material.emission == (0.0007, 0, 0)
    assert (material.metallic, material.roughness) == (1, 0.123)
    for nothing in (None, {}):
        (material,) = scene_of(nothing).materials
        assert material.diffuse == (1, 1, 1)
        assert (material.metallic, material.roughness) == (1, 1)


@pytest.mark.parametrize("texture_set", [0, 1, 2])
def test_textures_have_the_coordinates_that_they_name(scene_of, texture_set):
    file = File()
    texture = file.texture() | {"texCoord": texture_set}
    sets = {f"TEXCOORD_{number}": UVS + np.float32(number) for number in (1, 2)}
    scene = scene_of({"pbrMetallicRoughness": {"baseColorTexture": texture}}, file, **sets)
    if texture_set:
        assert len(scene.textures) == 1 and scene.uvs[..., 0].min() == texture_set
    else:
        assert not scene.textures and "has no coordinates for them" in scene.summary()


def test_a_texture_of_an_unknown_kind_is_refused_by_its_name(scene_of):
    file = File()
    unknown = {"EXT_texture_avif": {"source": 0}}
    texture = {"index": file.add("textures", extensions=unknown)}
    material = {"pbrMetallicRoughness": {"baseColorTexture": texture}}
    refused("EXT_texture_avif.*PNG", scene_of, material, file, unknown, TEXCOORD_0=UVS)


@pytest.mark.parametrize("unlit", [True, False])
def test_a_picture_that_is_base_and_emission_is_drawn_as_both(scene_of, unlit):
    file = File()
    texture = file.texture()
    base = {"baseColorTexture": texture, "metallicFactor": 0}
    glow = {"emissiveTexture": texture, "emissiveFactor": [1, 1, 1]}
    more = {"extensions": {"KHR_materials_unlit": {}}} if unlit else glow
    scene = scene_of({"pbrMetallicRoughness": base, **more}, file, TEXCOORD_0=UVS)
    (material,) = scene.materials
    assert material.texture == material.emission_texture == 0
    assert Needs.of(scene).physical, "kernels that read the texture of emission"


def test_glass_and_coats_are_read(scene_of, tmp_path):
    given = {
        "KHR_materials_ior": {"ior": 1.25}, "KHR_materials_transmission": {"transmissionFactor": 1},
        "KHR_materials_volume": {"thicknessFactor": 2, "attenuationColor": [1, 0.5, 0.25],
                                 "attenuationDistance": 0.5},
        "KHR_materials_clearcoat": {"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.05},
    }  # fmt: skip
    smooth = {"roughnessFactor": 0}
    scene = scene_of({"pbrMetallicRoughness": smooth, "extensions": given}, names=given)
    (material,) = scene.materials
    assert (material.ior, material.transmission, material.thin_walled) == (1.25, 1, False)
    assert (material.clearcoat, material.clearcoat_roughness) == (0.5, 0.05)
    np.testing.assert_allclose(material.absorption, [0, 2 * math.log(2), 4 * math.log(2)])
    assert Needs.of(scene).specular
    assert not scene.notes
    save_scene(tmp_path / "scene.npz", scene)
    assert read_scene(tmp_path / "scene.npz").materials == scene.materials


def test_a_pane_without_volume_is_thin(scene_of):
    pane = {"KHR_materials_transmission": {"transmissionFactor": 0.5}}
    scene = scene_of({"extensions": pane}, names=pane)
    assert scene.materials[0].thin_walled and scene.materials[0].transmission == 0.5


@pytest.mark.parametrize("least", [0, 255])
def test_blended_alpha_is_opacity(scene_of, least):
    file = File()
    texels = np.full((2, 2, 4), 255, np.uint8)
    texels[0, 0, 3] = least
    base = {"baseColorTexture": file.texture(texels), "baseColorFactor": [1, 1, 1, 0.25]}
    material = {"alphaMode": "BLEND", "pbrMetallicRoughness": base}
    scene = scene_of(material, file, TEXCOORD_0=UVS)
    (read,) = scene.materials
    assert (read.opacity, read.alpha_cutoff) == (0.25, 0) and Needs.of(scene).specular
    assert scene.has_alpha_blend(read) == (least < 255) and "transparency" not in scene.summary()
